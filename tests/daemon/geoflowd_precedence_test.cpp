#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/types.h>

#include "geoflowd_fixture.hpp"
#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;
using tests::Process;

/// Both, by a daemon that replays.
Words asked() {
  return {"--set", "pipeline.priority=1", "--set", "pipeline.lock_memory=true"};
}
constexpr const char* kRefused = "is not allowed";

/// Bytes that a process has locked, in KiB.
long locked_kib(pid_t process) {
  std::ifstream status{"/proc/" + std::to_string(process) + "/status"};
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmLck:")) {
      return std::stol(line.substr(line.find_first_of("0123456789")));
    }
  }
  return -1;
}

TEST_F(GeoflowdService, MemoryIsLockedWhereThatIsAllowed) {
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
  GTEST_SKIP() << "sanitizers make nothing of mlockall";
#endif
#endif
  const Process process{daemon({}, joined(replay(), asked())), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  if (process.err().find("memory is not locked") != std::string::npos) {
    GTEST_SKIP() << process.err();
  }
  constexpr long kAFewMiB = 4096;
  EXPECT_GT(locked_kib(process.pid()), kAFewMiB);
}

TEST_F(GeoflowdService, ThreadsOfThePoseGoFirstWhereThatIsAllowed) {
  // A minute, in which no thread ends and gives way to the next round's.
  const tests::SyntheticRecording minute{.frames = 240, .rate_hz = 4, .shift_px = 1};
  const Process process{daemon({}, joined(replay(minute), asked())), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  if (process.err().find(kRefused) != std::string::npos) {
    GTEST_SKIP() << process.err();
  }
  EXPECT_EQ(::sched_getscheduler(process.pid()), SCHED_OTHER);  // clients cannot use it
  for (const char* name : {"replay", "sync", "slam"}) {
    int first = 0;
    for (const pid_t thread : find_threads(process.pid(), name)) {
      first += (::sched_getscheduler(thread) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO ? 1 : 0;
    }
    EXPECT_EQ(first, 1) << name;  // and none of its helpers
  }
}

TEST_F(GeoflowdService, WhereNeitherIsAllowedItSaysWhatWouldAllowItAndGoesOn) {
  if (!std::filesystem::exists("/usr/bin/setpriv") ||
      !std::filesystem::exists("/usr/bin/prlimit")) {
    GTEST_SKIP() << "util-linux is not here";
  }
  const Words without = {"/usr/bin/prlimit", "--rtprio=0",          "--memlock=65536",
                         "/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all"};
  const Process process{joined(without, daemon({}, joined(replay(), asked()))), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  EXPECT_THAT(process.err(),
              HasSubstr("real-time priority 1 is not allowed: Operation not permitted; a "
                        "service is given it by LimitRTPRIO="));
  EXPECT_THAT(process.err(),
              HasSubstr("memory is not locked: Operation not permitted; a service is "
                        "given it by LimitMEMLOCK=infinity"));
}

}  // namespace
}  // namespace geoflow::daemon
