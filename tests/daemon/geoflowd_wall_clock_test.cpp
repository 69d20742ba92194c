#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::chrono::hours kAhead{20 * 24};  // wall_clock_shim.c
constexpr Duration kPatience = std::chrono::seconds{60};

std::optional<PoseClient> connect_when_up(const std::filesystem::path& socket) {
  const HostTime end = HostClock::now() + kPatience;
  while (HostClock::now() < end) {
    if (auto client = PoseClient::connect(socket, {.name = "test"})) {
      return *std::move(client);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  return std::nullopt;
}

TEST(GeoflowdWallClock, AStepChangesNothingButWhatIsSaidOfIt) {
  const tests::TemporaryDirectory folder;
  const auto socket = folder.path() / "pose.sock";
  const auto sign = folder.path() / "ahead";
  tests::write_synthetic_recording(folder.path() / "recording", {.frames = 300});
  // NOLINTBEGIN(concurrency-mt-unsafe): no other thread yet
  ::setenv("LD_PRELOAD", WALL_CLOCK_SHIM, 1);
  ::setenv("GEOFLOW_WALL_CLOCK_AHEAD", sign.c_str(), 1);
  const tests::Process daemon{{GEOFLOWD_PROGRAM, "--replay", (folder.path() / "recording").string(),
                               "--pose-socket", socket.string(), "--control-socket", ""},
                              folder.path() / "daemon"};
  ::unsetenv("LD_PRELOAD");
  // NOLINTEND(concurrency-mt-unsafe)
  auto client = connect_when_up(socket);
  ASSERT_TRUE(client) << daemon.err();
  std::vector<geoflow_pose> poses;
  while (poses.size() < 40) {
    const auto received = client->receive(kPatience);
    ASSERT_TRUE(received && std::holds_alternative<ReceivedPose>(*received)) << daemon.err();
    const geoflow_pose& pose = std::get<ReceivedPose>(*received).pose;
    if (pose.status == GEOFLOW_TRACKING || !poses.empty()) {
      poses.push_back(pose);
    }
    if (poses.size() == 20) {
      std::ofstream{sign} << "now";
    }
  }
  const std::int64_t step_ns =
      poses.back().realtime_minus_mono_ns - poses.front().realtime_minus_mono_ns;
  EXPECT_NEAR(static_cast<double>(step_ns), static_cast<double>(Duration{kAhead}.count()), 1e9);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].status, static_cast<std::uint8_t>(GEOFLOW_TRACKING)) << i;
    const std::int64_t frame_ns = poses[i].t_capture_ns - poses[i - 1].t_capture_ns;
    const auto frames = static_cast<std::int64_t>(poses[i].frame - poses[i - 1].frame);
    EXPECT_NEAR(static_cast<double>(frame_ns), static_cast<double>(frames) / 30 * 1e9, 1e6) << i;
    EXPECT_EQ(poses[i].reset_counter, poses[0].reset_counter);
  }
}

}  // namespace
}  // namespace geoflow::daemon
