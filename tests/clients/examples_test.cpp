#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow {
namespace {

using std::chrono::seconds;
using testing::AnyOf;
using testing::HasSubstr;
using tests::Process;
using tests::run_process;

/// The client libraries' examples with the daemon itself.
class ClientExamples : public testing::Test {
 protected:
  static constexpr int kPoses = 20;

  void SetUp() override { tests::write_synthetic_recording(path() / "recording", {.frames = 60}); }
  [[nodiscard]] const std::filesystem::path& path() const { return directory_.path(); }

  /// Runs the example with the daemon; checks what it prints.
  void expect_poses(std::vector<std::string> example) {
    Process daemon{{GEOFLOWD_PROGRAM, "--replay", (path() / "recording").string(), "--loop",
                    "--pose-socket", socket_.string(), "--control-socket", ""},
                   path() / "daemon"};
    const HostTime deadline = HostClock::now() + seconds{60};
    while (!std::filesystem::exists(socket_)) {
      ASSERT_LT(HostClock::now(), deadline) << daemon.err();
      std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
    example.insert(example.end(), {socket_.string(), std::to_string(kPoses)});
    const auto finished = run_process(example, path() / "example");
    EXPECT_EQ(finished.code, 0) << finished.err;
    expect_lines(finished.out);
    daemon.send_signal(SIGTERM);
    EXPECT_EQ(daemon.wait(seconds{60}), 0) << daemon.err();
  }

  static void expect_lines(const std::string& out) {
    std::istringstream lines{out};
    std::string status;
    long frame = -1;
    double x = 0;
    double y = 0;
    double z = 0;
    double age_ms = 0;
    int count = 0;
    double farthest = 0;
    while (lines >> status >> frame >> x >> y >> z >> age_ms) {
      EXPECT_THAT(status, AnyOf("TRACKING", "DEGRADED", "RELOCALISING"));
      EXPECT_GE(frame, 0);
      EXPECT_GT(age_ms, 0);
      EXPECT_LT(age_ms, 60e3);
      farthest = std::max(farthest, std::hypot(x, y, z));
      ++count;
    }
    EXPECT_EQ(count, kPoses) << out;
    EXPECT_GT(farthest, 0.02) << "the camera moves 2 cm a frame";
  }

  tests::TemporaryDirectory directory_;
  std::filesystem::path socket_ = directory_.path() / "pose.sock";
};

TEST_F(ClientExamples, InC) {
  expect_poses({GEOFLOW_C_EXAMPLE});
}

TEST_F(ClientExamples, InPython) {
  expect_poses({GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE});
}

TEST_F(ClientExamples, WithoutADaemonTheySaySo) {
  for (const std::vector<std::string>& example : std::vector<std::vector<std::string>>{
           {GEOFLOW_C_EXAMPLE}, {GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE}}) {
    std::vector<std::string> words = example;
    words.push_back(socket_.string());
    const auto finished = run_process(words, path() / "example");
    EXPECT_EQ(finished.code, 4);
    EXPECT_THAT(finished.err, HasSubstr(socket_.string() + ": No such file"));
  }
}

}  // namespace
}  // namespace geoflow
