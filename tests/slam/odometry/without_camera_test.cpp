#include <cstddef>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/core.hpp"

#include "odometry/simulated_walk.hpp"

/// A robot whose camera shows nothing, or is not there, is carried by its legs and IMU.
namespace geoflow::slam {
namespace {

TEST(WithoutCamera, LegsAndImuCarryThePoseAndSayHowWell) {
  SimulatedWalk walk{5};
  walk.calibration.camera = {
      .width = 640, .height = 480, .fx = 380, .fy = 380, .cx = 320, .cy = 240};
  const auto core = Core::create(walk.calibration, {}).value();
  const SE3 T_world_base0 = walk.T_world_base(kFrameS);
  std::size_t packets = 0;
  double way_m = 0;
  PoseEstimate estimate;
  for (double t_s = kFrameS; t_s < kWalkS - kFrameS; t_s += kFrameS) {
    estimate = core->process(walk.samples_until(t_s));
    ++packets;
    way_m += walk.v_world_base(t_s).norm() * kFrameS;
    if (t_s > 2) {
      ASSERT_EQ(estimate.status, TrackingStatus::kDegraded) << t_s << " s";
      ASSERT_EQ(estimate.source, PoseSource::kLegs) << t_s << " s";
    }
    const SE3 T_base0_base = T_world_base0.inverse() * walk.T_world_base(t_s);
    const SE3& T_base0_estimated = estimate.T_odom_base;  // frames: odom is base at the start
    const Vector6d error = (T_base0_estimated.inverse() * T_base0_base).log();
    ASSERT_LT(error.tail<3>().norm(), 0.02 + 0.01 * way_m) << t_s << " s";
    const double nees = error.dot(estimate.covariance.ldlt().solve(error)) / 6;
    ASSERT_TRUE(t_s < 2 || nees < 6) << t_s << " s: " << nees;
  }
  EXPECT_GT(way_m, 5);
  EXPECT_FALSE(core->take_mapping_task().has_value());
  const Trajectory trajectory = core->final_trajectory();
  ASSERT_EQ(trajectory.size(), packets);
  EXPECT_EQ(trajectory.back().pose.translation(), estimate.T_odom_base.translation());
}

}  // namespace
}  // namespace geoflow::slam
