#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"

/// The programs on a real recording.
namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using tests::Process;
using tests::run_process;

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file{path};
  return {std::istreambuf_iterator<char>{file}, {}};
}

TEST(Kitchen, EveryFrameIsTrackedAndTwoReplaysAreEqualToTheByte) {
  GEOFLOW_DATA_OR_SKIP(kitchen, "kitchen-400");
  const tests::TemporaryDirectory directory;
  for (const char* name : {"a", "b"}) {
    const auto run = run_process(
        {GEOFLOW_PROGRAM, "replay", kitchen.string(), "-o", (directory.path() / name).string()},
        directory.path() / "log");
    ASSERT_EQ(run.code, 0) << run.err;
  }
  const auto report = nlohmann::json::parse(read_text(directory.path() / "a" / "report.json"));
  EXPECT_EQ(report["frames"], 400);
  EXPECT_EQ(report["tracked"], 400);
  for (const char* name :
       {"live_camera.txt", "live_base.txt", "final_camera.txt", "final_base.txt"}) {
    const std::string text = read_text(directory.path() / "a" / name);
    EXPECT_EQ(text, read_text(directory.path() / "b" / name)) << name;
    EXPECT_EQ(std::ranges::count(text, '\n'), 401) << name;
  }
}

double percentile(const std::vector<double>& sorted, double share) {
  return sorted.at(static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1)));
}

// Prints the figures; what they must be is judged on a machine of which the load is known
// (docs/benchmarks.md).
TEST(Kitchen, LiveAtThirtyFramesASecondEveryFrameReachesTheSocketOrIsCounted) {
  GEOFLOW_DATA_OR_SKIP(kitchen, "kitchen-400");
  const tests::TemporaryDirectory directory;
  const std::string socket = (directory.path() / "pose.sock").string();
  const HostTime begin = HostClock::now();
  Process process{{GEOFLOWD_PROGRAM, "--replay", kitchen.string(), "--realtime", "--pose-socket",
                   socket, "--control-socket", ""},
                  directory.path() / "daemon"};
  auto client = PoseClient::connect(socket, {.name = "kitchen test"});
  while (!client && HostClock::now() - begin < seconds{20}) {
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
    client = PoseClient::connect(socket, {.name = "kitchen test"});
  }
  ASSERT_TRUE(client) << client.error().message;
  std::vector<double> latencies_ms;
  double first_pose_s = 0;
  std::uint64_t missed = 0;
  geoflow_pose last{};
  for (bool ended = false; !ended;) {
    const auto received = client->receive(seconds{60});
    ASSERT_TRUE(received);
    ASSERT_FALSE(std::holds_alternative<PoseClient::TimedOut>(*received));
    if (const auto* pose = std::get_if<ReceivedPose>(&*received)) {
      first_pose_s = latencies_ms.empty() ? to_seconds(pose->t_received - begin) : first_pose_s;
      latencies_ms.push_back(
          to_seconds(pose->t_received.time_since_epoch() - Duration{pose->pose.t_arrival_ns}) *
          1e3);
      missed += pose->dropped;
      last = pose->pose;
    }
    ended = std::holds_alternative<PoseClient::Ended>(*received);
  }
  EXPECT_EQ(process.wait(seconds{20}), 0) << process.err();
  std::ranges::sort(latencies_ms);
  fmt::print(
      "live: {} poses, {} missed by the client, {} frames dropped, arrival to socket p50 {:.1f} ms "
      "p99 {:.1f} ms "
      "max {:.1f} ms, start to first pose {:.3f} s\n",
      latencies_ms.size(), missed, last.frames_dropped, percentile(latencies_ms, 0.5),
      percentile(latencies_ms, 0.99), latencies_ms.back(), first_pose_s);
  EXPECT_EQ(latencies_ms.size() + missed + last.frames_dropped, 400U);
  EXPECT_EQ(last.frame, 399U);
}

}  // namespace
}  // namespace geoflow::daemon
