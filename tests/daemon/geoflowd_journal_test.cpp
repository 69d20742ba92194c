#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "geoflowd_fixture.hpp"
#include "process.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using tests::Process;

/// The daemon with a journal that is played by a file (journal_shim.c).
class GeoflowdJournal : public GeoflowdService {
 protected:
  /// $JOURNAL_STREAM that names this file.
  static std::string stream_of(const std::filesystem::path& file) {
    struct stat status{};
    EXPECT_EQ(::stat(file.c_str(), &status), 0);
    return "JOURNAL_STREAM=" + std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
  }
  [[nodiscard]] Words with_journal(const std::string& stream, const Words& options) const {
    return daemon({"LD_PRELOAD=" JOURNAL_SHIM, stream}, options);
  }
  /// What it says on stderr, from its start to its end.
  [[nodiscard]] std::string log_with(const std::string& name, const std::string& stream) {
    Process process{with_journal(stream, absent_camera()), log(name)};
    EXPECT_TRUE(manager_.wait_for("READY=1")) << process.err();
    process.send_signal(SIGTERM);
    EXPECT_EQ(process.wait(seconds{60}), 0);
    return process.err();
  }
};

TEST_F(GeoflowdJournal, GetsEachLineWithFieldsForTheSensorAndTheStatus) {
  std::ofstream{log("daemon.err")} << "";
  const std::filesystem::path journal = path() / "journal";
  Words words = with_journal(stream_of(log("daemon.err")), replay());
  words.insert(words.begin() + 1, "GEOFLOW_JOURNAL=" + journal.string());
  Process process{words, log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{60}), 0);
  EXPECT_EQ(process.err(), "");
  std::ifstream file{journal};
  const std::string entries{std::istreambuf_iterator<char>{file}, {}};
  EXPECT_THAT(entries, HasSubstr("MESSAGE=daemon: stopping on signal 15\nPRIORITY=6\n"
                                 "SYSLOG_IDENTIFIER=geoflowd\nGEOFLOW_CATEGORY=daemon\n\n"));
  EXPECT_THAT(entries, HasSubstr("GEOFLOW_CATEGORY=status\nGEOFLOW_STATUS=TRACKING\n\n"));
  EXPECT_THAT(entries, HasSubstr("MESSAGE=status: camera ok\nPRIORITY=6\n"));
  EXPECT_THAT(entries, HasSubstr("\nGEOFLOW_SENSOR=camera\nGEOFLOW_STATE=streaming\n\n"));
}

TEST_F(GeoflowdJournal, WhatItDoesNotTakeGoesToStderrWithPriorities) {
  std::ofstream{log("refused.err")} << "";
  const std::string refused = log_with("refused", stream_of(log("refused.err")));
  EXPECT_THAT(refused, AllOf(StartsWith("<"), HasSubstr("<6>daemon: stopping on signal 15")));
}

TEST_F(GeoflowdJournal, IsNotAskedWhereStderrIsAnotherFile) {
  std::ofstream{log("another.err")} << "";
  const std::string elsewhere = log_with("elsewhere", stream_of(log("another.err")));
  EXPECT_THAT(elsewhere,
              AllOf(HasSubstr("info daemon: stopping on signal 15"), Not(HasSubstr("<6>"))));
}

}  // namespace
}  // namespace geoflow::daemon
