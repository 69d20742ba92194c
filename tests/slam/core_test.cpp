#include "geoflow/slam/core.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core/mat.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/config.hpp"

#include "vision/textured_wall.hpp"

namespace geoflow::slam {
namespace {

constexpr double kDistanceM = 1.5;
constexpr double kStepM = 0.02;
constexpr int kFrames = 12;

/// The frame `i` of one that sees `gray` and, everywhere, a depth; they are 20 ms apart.
SyncedPacket frame(int i, const cv::Mat1b& gray, double depth_m) {
  SyncedPacket packet;
  packet.t = HostTime{std::chrono::milliseconds{1000 + 20 * i}};
  packet.sequence = static_cast<std::uint64_t>(i);
  packet.color = FramePool{1}.acquire({gray.cols, gray.rows, PixelFormat::kGray8});
  std::ranges::copy(std::as_bytes(std::span{gray.data, gray.total()}),
                    packet.color.writable_bytes().begin());
  packet.depth = FramePool{1}.acquire({gray.cols, gray.rows, PixelFormat::kDepth16});
  const std::vector<std::uint16_t> millimetres(
      gray.total(), static_cast<std::uint16_t>(std::lround(1e3 * depth_m)));
  std::ranges::copy(std::as_bytes(std::span{millimetres}), packet.depth.writable_bytes().begin());
  return packet;
}

/// Twelve frames of a wall, 2 cm sideways apart.
std::vector<SyncedPacket> walk_along_a_wall() {
  const TexturedWall wall{kDistanceM, 3};
  std::vector<SyncedPacket> packets;
  for (int i = 0; i < kFrames; ++i) {
    packets.push_back(
        frame(i, wall.seen_from({Eigen::Quaterniond::Identity(), {kStepM * i, 0, 0}}), kDistanceM));
  }
  return packets;
}

TEST(Core, ThePoseDoesNotWaitForItsKeyframeNorDependOnWhenThatIsMade) {
  Calibration calibration;
  calibration.camera = wall_camera();
  const auto at_once = Core::create(calibration, {}).value();
  const auto late = Core::create(calibration, {}).value();
  for (const SyncedPacket& packet : walk_along_a_wall()) {
    const PoseEstimate expected = at_once->process(packet);
    at_once->extend_map();
    const PoseEstimate estimate = late->process(packet);
    EXPECT_EQ(estimate.status, TrackingStatus::kTracking);
    EXPECT_EQ(estimate.T_odom_base.translation(), expected.T_odom_base.translation());
    EXPECT_EQ(estimate.T_odom_base.rotation().coeffs(), expected.T_odom_base.rotation().coeffs());
  }
  const double way = kStepM * (kFrames - 1);
  const Trajectory trajectory = late->final_trajectory();
  EXPECT_NEAR(trajectory.back().pose.translation().norm(), way, 0.05 * way);
  // Within 22 cm there is more than the first keyframe.
  EXPECT_TRUE(at_once->take_mapping_task().has_value());
  EXPECT_TRUE(late->take_mapping_task().has_value());
}

TEST(Core, BegunWithoutDepthItFollowsTheMapFromTheFirstDepthOn) {
  Calibration calibration;
  calibration.camera = wall_camera();
  const auto core = Core::create(calibration, {}).value();
  std::vector<SyncedPacket> packets = walk_along_a_wall();
  constexpr std::size_t kWithoutDepth = 3;
  for (SyncedPacket& packet : std::span{packets}.first(kWithoutDepth)) {
    packet.depth = FrameRef{};
  }
  std::vector<PoseEstimate> estimates;
  for (const SyncedPacket& packet : packets) {
    estimates.push_back(core->process(packet));
  }
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    EXPECT_EQ(estimates[i].status,
              i < kWithoutDepth ? TrackingStatus::kInitialising : TrackingStatus::kTracking)
        << i;
  }
  EXPECT_EQ(core->final_trajectory().size(), packets.size());
  const double seen = static_cast<double>(packets.size() - kWithoutDepth - 1);
  const SE3& T_odom_base0 = estimates[kWithoutDepth].T_odom_base;
  const SE3& T_odom_base1 = estimates.back().T_odom_base;
  const SE3 T_base0_base1 = T_odom_base0.inverse() * T_odom_base1;
  EXPECT_NEAR(T_base0_base1.translation().norm(), kStepM * seen, 0.05 * kStepM * seen);
}

// What a noisy image of a white wall gives: features of which the next frame has none.
TEST(Core, WhereDepthCarriesOnLostFeaturesMakeNoKeyframes) {
  constexpr double kNearerM = 0.012;
  Calibration calibration;
  calibration.camera = wall_camera();
  const auto core = Core::create(calibration, {}).value();
  int keyframes = 1;  // the first has nothing to be adjusted to
  double way = 0;
  for (int i = 0; i < kFrames; ++i) {
    const cv::Mat1b other_each_time =
        TexturedWall{kDistanceM, static_cast<std::uint64_t>(100 + i)}.seen_from(SE3{});
    way = kNearerM * i;
    (void)core->process(frame(i, other_each_time, kDistanceM - way));
    core->extend_map();
    keyframes += core->take_mapping_task().has_value() ? 1 : 0;
  }
  EXPECT_NEAR(core->final_trajectory().back().pose.translation().norm(), way, 0.05 * way);
  // One each time that the camera has moved by more than 12 cm.
  EXPECT_EQ(keyframes, 1 + static_cast<int>(way / KeyframeConfig{}.translation_m));
}

}  // namespace
}  // namespace geoflow::slam
