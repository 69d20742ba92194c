#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <map>
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

  /// What the example prints of a daemon that runs.
  [[nodiscard]] std::string run(std::vector<std::string> example) const {
    Process daemon{{GEOFLOWD_PROGRAM, "--replay", (path() / "recording").string(), "--loop",
                    "--pose-socket", socket_.string(), "--control-socket", ""},
                   path() / "daemon"};
    const HostTime deadline = HostClock::now() + seconds{60};
    while (!std::filesystem::exists(socket_)) {
      if (HostClock::now() > deadline) {
        throw std::runtime_error{"no socket: " + daemon.err()};
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
    example.insert(example.end(), {socket_.string(), std::to_string(kPoses)});
    const auto finished = run_process(example, path() / "example");
    EXPECT_EQ(finished.code, 0) << finished.err;
    daemon.send_signal(SIGTERM);
    EXPECT_EQ(daemon.wait(seconds{60}), 0) << daemon.err();
    return finished.out;
  }

  static void expect_images(const std::string& out) {
    std::istringstream lines{out};
    std::string stream;
    std::map<std::string, int> counts;
    long frame = -1;
    int width = 0;
    int height = 0;
    double mean = 0;
    while (lines >> stream >> frame >> width >> height >> mean) {
      EXPECT_GE(frame, 0);
      EXPECT_EQ(width, 320);
      EXPECT_EQ(height, 240);
      const bool is_depth = stream == "depth";
      EXPECT_GT(mean, is_depth ? 0.5 : 20);  // the wall is 1.3 m away
      EXPECT_LT(mean, is_depth ? 1.5 : 235);
      ++counts[stream];
    }
    EXPECT_EQ(counts["color"] + counts["depth"], kPoses) << out;
    EXPECT_GT(counts["color"], 0);
    EXPECT_GT(counts["depth"], 0);
  }

  static void expect_poses(const std::string& out) {
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
  expect_poses(run({GEOFLOW_C_EXAMPLE}));
}

TEST_F(ClientExamples, InPython) {
  expect_poses(run({GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE}));
}

TEST_F(ClientExamples, OfImagesInC) {
  expect_images(run({GEOFLOW_C_EXAMPLE_FRAMES}));
}

TEST_F(ClientExamples, OfImagesInPython) {
  expect_images(run({GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE_FRAMES}));
}

TEST_F(ClientExamples, WithoutADaemonTheySaySo) {
  for (const std::vector<std::string>& example : std::vector<std::vector<std::string>>{
           {GEOFLOW_C_EXAMPLE},
           {GEOFLOW_C_EXAMPLE_FRAMES},
           {GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE},
           {GEOFLOW_PYTHON, "-B", GEOFLOW_PYTHON_EXAMPLE_FRAMES}}) {
    std::vector<std::string> words = example;
    words.push_back(socket_.string());
    const auto finished = run_process(words, path() / "example");
    EXPECT_EQ(finished.code, 4);
    EXPECT_THAT(finished.err, HasSubstr(socket_.string() + ": No such file"));
  }
}

}  // namespace
}  // namespace geoflow
