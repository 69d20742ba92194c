#include <cerrno>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "geoflowd_fixture.hpp"
#include "process.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;
using tests::Process;
using tests::run_process;

TEST_F(GeoflowdService, IsReadyWhenItListensThenTellsItsStateAndThatItStops) {
  Process process{daemon({"WATCHDOG_USEC=1000000"}, replay()), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  const auto client = PoseClient::connect(pose_, {.name = "test"});
  EXPECT_TRUE(client) << client.error().message;
  EXPECT_EQ(status().at("source").at("open"), true);
  EXPECT_TRUE(manager_.wait_for("STATUS=TRACKING "));
  EXPECT_THAT(manager_.messages().back(), HasSubstr("; camera ok"));
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1"));
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1"));
  process.send_signal(SIGTERM);
  EXPECT_TRUE(manager_.wait_for("STOPPING=1"));
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
}

TEST_F(GeoflowdService, TellsTheAgeOfASensorsNewestSampleAndThatItIsSilent) {
  const std::filesystem::path faults = path() / "faults.toml";
  std::ofstream{faults}
      << "[[fault]]\nkind = \"gap\"\nstream = \"camera\"\nfrom_s = 5.0\nuntil_s = 50.0\n";
  const Process process{daemon({}, joined(replay({.frames = 240, .rate_hz = 4, .shift_px = 1}),
                                          {"--faults", faults.string()})),
                        log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  const auto heard = status().at("health").at("camera");
  EXPECT_EQ(heard.at("state"), "streaming");
  EXPECT_LT(heard.at("last_sample_s").get<double>(), 1.5);
  ASSERT_TRUE(manager_.wait_for("camera silent")) << process.err();
  const auto silent = status().at("health").at("camera");
  EXPECT_EQ(silent.at("state"), "silent");
  EXPECT_GT(silent.at("last_sample_s").get<double>(), 1.5);
}

TEST_F(GeoflowdService, ARecordingThatIsNotThereIsAnErrorBeforeItIsReady) {
  const auto done = run_process(daemon({}, {"--replay", log("nothing").string()}), log("daemon"));
  EXPECT_EQ(done.code, 3);
  EXPECT_THAT(done.err, HasSubstr("nothing"));
  EXPECT_TRUE(manager_.is_silent_of("READY=1", std::chrono::milliseconds{1}));
}

TEST_F(GeoflowdService, WaitsForACameraThatIsNotThere) {
  Process process{daemon({"WATCHDOG_USEC=1000000"}, absent_camera()), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  ASSERT_TRUE(manager_.wait_for("STATUS=STARTING; no D435i with the serial number 000000000000"))
      << process.err();
  const auto client = PoseClient::connect(pose_, {.name = "test"});
  EXPECT_TRUE(client) << client.error().message;
  for (int i = 0; i < 12; ++i) {  // three periods: waiting is not being stuck
    ASSERT_TRUE(manager_.wait_for("WATCHDOG=1")) << process.err();
  }
  const auto source = status().at("source");
  EXPECT_EQ(source.at("open"), false);
  EXPECT_THAT(source.at("trouble").get<std::string>(), HasSubstr("no D435i"));
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
  EXPECT_THAT(process.err(), HasSubstr("it is waited for"));
}

/// Stops the threads of that name, as a debugger does, and leaves the others. Those that it has
/// stopped; none, with errno, where that is not allowed.
std::vector<pid_t> stop_threads(pid_t process, const std::string& name) {
  std::vector<pid_t> stopped;
  errno = ESRCH;
  for (const pid_t thread : find_threads(process, name)) {
    int status = 0;
    if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) == 0 &&
        ::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 &&
        ::waitpid(thread, &status, __WALL) == thread && WIFSTOPPED(status)) {
      stopped.push_back(thread);
    }
  }
  return stopped;
}

class StuckThread : public GeoflowdService, public testing::WithParamInterface<const char*> {};

TEST_P(StuckThread, StarvesTheWatchdogUntilItMovesAgain) {
  // A minute, in which no thread ends and gives way to the next round's.
  const Process process{
      daemon({"WATCHDOG_USEC=1000000"}, replay({.frames = 240, .rate_hz = 4, .shift_px = 1})),
      log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  ASSERT_TRUE(manager_.wait_for("WATCHDOG=1"));
  const std::vector<pid_t> threads = stop_threads(process.pid(), GetParam());
  if (threads.empty() && errno == EPERM) {
    GTEST_SKIP() << "ptrace is not allowed here";
  }
  ASSERT_FALSE(threads.empty()) << std::generic_category().message(errno);
  bool starved = false;
  for (int i = 0; i < 100 && !starved; ++i) {
    starved = manager_.is_silent_of("WATCHDOG=1", seconds{3});
  }
  EXPECT_TRUE(starved) << process.err();
  for (const pid_t thread : threads) {
    ASSERT_EQ(::ptrace(PTRACE_DETACH, thread, nullptr, nullptr), 0);
  }
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1")) << process.err();
}

INSTANTIATE_TEST_SUITE_P(Threads, StuckThread, testing::Values("replay", "sync", "slam"));

TEST_F(GeoflowdService, UsesTheSocketsThatItIsGivenAndLeavesTheirFiles) {
  const UniqueFd pose = listening(path() / "given.pose", SOCK_SEQPACKET);
  const UniqueFd control = listening(path() / "given.ctl", SOCK_STREAM);
  // Connected before the daemon is there: it waits in the backlog.
  Process process{activated(control, pose, "control:pose", replay()), log("daemon")};
  const auto client = PoseClient::connect(path() / "given.pose", {.name = "early"});
  ASSERT_TRUE(client) << client.error().message;
  EXPECT_TRUE(manager_.wait_for("READY=1")) << process.err();
  EXPECT_FALSE(std::filesystem::exists(pose_));
  EXPECT_FALSE(std::filesystem::exists(control_));
  control_ = path() / "given.ctl";
  EXPECT_EQ(status().at("pose_socket").at("clients").size(), 1U);
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
  EXPECT_TRUE(std::filesystem::is_socket(path() / "given.pose"));
  EXPECT_TRUE(std::filesystem::is_socket(path() / "given.ctl"));
}

TEST_F(GeoflowdService, RefusesGivenSocketsThatItCannotUse) {
  const UniqueFd pose = listening(path() / "given.pose", SOCK_SEQPACKET);
  const UniqueFd control = listening(path() / "given.ctl", SOCK_STREAM);
  const auto refused = [&](const UniqueFd& first, const UniqueFd& second,
                           const std::string& names) {
    const auto done = run_process(activated(first, second, names, absent_camera()), log("refused"));
    EXPECT_EQ(done.code, 2) << names;
    return done.err;
  };
  EXPECT_THAT(refused(pose, control, "pose:geoflow.socket"),
              HasSubstr("'geoflow.socket' is none of geoflowd's sockets"));
  EXPECT_THAT(
      refused(control, pose, "pose:control"),
      HasSubstr("'pose' (descriptor 3) is not a listening Unix socket of type SOCK_SEQPACKET"));
  EXPECT_THAT(refused(pose, pose, "pose:pose"), HasSubstr("'pose' stands there twice"));
  EXPECT_THAT(refused(pose, control, "pose"), HasSubstr("$LISTEN_FDS=2"));
  const auto closed = run_process(
      joined({"/bin/bash", "-c", "export LISTEN_PID=$$ LISTEN_FDS=30; exec \"$@\"", "bash"},
             daemon({}, absent_camera())),
      log("closed"));
  EXPECT_EQ(closed.code, 2);
  EXPECT_THAT(closed.err, HasSubstr("$LISTEN_FDS=30"));
}

TEST_F(GeoflowdService, DoesNotTakeThePathOfASocketThatAnotherListensAt) {
  const UniqueFd another = listening(pose_, SOCK_SEQPACKET);
  const auto refused = run_process(daemon({}, absent_camera()), log("refused"));
  EXPECT_EQ(refused.code, 4);
  EXPECT_THAT(refused.err, HasSubstr("another process (" + std::to_string(::getpid()) + ")"));
  EXPECT_TRUE(std::filesystem::is_socket(pose_));
}

TEST_F(GeoflowdService, ComesUpAgainAfterItWasKilled) {
  for (int i = 0; i < 3; ++i) {
    Process process{daemon({}, absent_camera()), log("daemon")};
    ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
    EXPECT_TRUE(PoseClient::connect(pose_, {.name = "test"}));
    process.send_signal(SIGKILL);
    EXPECT_EQ(process.wait(seconds{60}), 128 + SIGKILL);
    EXPECT_TRUE(std::filesystem::is_socket(pose_));  // left behind
  }
}

}  // namespace
}  // namespace geoflow::daemon
