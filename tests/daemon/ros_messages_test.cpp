#include "bus/ros_messages.hpp"

#include <chrono>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"

#include "service/status_line.hpp"

namespace geoflow::daemon::bus {
namespace {

using Level = drivers::RosDiagnostic::Level;

/// At (1, 2, 3), turned by 90 degrees to the left.
PoseEstimate estimate() {
  PoseEstimate estimate;
  estimate.t = HostTime{std::chrono::seconds{50}};
  estimate.status = TrackingStatus::kTracking;
  Vector6d turn = Vector6d::Zero();
  turn[2] = std::numbers::pi / 2;
  estimate.T_odom_base = SE3{SE3::exp(turn).rotation(), Vector3d{1, 2, 3}};
  estimate.T_map_odom = SE3{Matrix3d::Identity(), Vector3d{7, 0, 0}};
  estimate.v_odom_base = Vector3d{0, 0.5, 0};
  estimate.w_base = Vector3d{0.1, 0.2, 0.3};
  return estimate;
}

geoflow_pose record(const PoseEstimate& estimate) {
  return make_pose(SyncedPacket{}, estimate, PoseContext{});
}

TEST(RosMessages, PoseAndTwistAreInTheFramesOfNavMsgs) {
  const auto pose = make_ros_pose(record(estimate()), {});
  ASSERT_TRUE(pose);
  EXPECT_TRUE(pose->T_odom_base.translation().isApprox(Vector3d{1, 2, 3}));
  EXPECT_TRUE(pose->T_odom_base.rotation().isApprox(estimate().T_odom_base.rotation()));
  EXPECT_TRUE(pose->T_map_odom.translation().isApprox(Vector3d{7, 0, 0}));
  // It moves along odom's y, which is straight ahead for it.
  EXPECT_TRUE(pose->v_base.isApprox(Vector3d{0.5, 0, 0}));
  EXPECT_TRUE(pose->w_base.isApprox(Vector3d{0.1, 0.2, 0.3}));
}

TEST(RosMessages, ThePosesCovarianceIsAlongAndAboutTheFixedAxes) {
  PoseEstimate turned = estimate();
  // Tangent order is (rotation, translation), in base: uncertain in roll, ahead, and both together.
  turned.covariance(0, 0) = 0.04;
  turned.covariance(3, 3) = 0.25;
  turned.covariance(0, 3) = turned.covariance(3, 0) = 0.03;
  turned.covariance(5, 5) = 0.01;
  const auto pose = make_ros_pose(record(turned), {});
  ASSERT_TRUE(pose);
  // x y z rx ry rz about odom's axes: base's x is odom's y.
  Matrix6d expected = Matrix6d::Zero();
  expected(1, 1) = 0.25;
  expected(4, 4) = 0.04;
  expected(1, 4) = expected(4, 1) = 0.03;
  expected(2, 2) = 0.01;
  EXPECT_TRUE(pose->pose_covariance.isApprox(expected, 1e-12)) << pose->pose_covariance;
}

TEST(RosMessages, TheTwistsCovarianceIsAsConfigured) {
  const RosConfig config{.velocity_sigma_mps = 0.2, .angular_velocity_sigma_radps = 0.3};
  const auto pose = make_ros_pose(record(estimate()), config);
  ASSERT_TRUE(pose);
  Vector6d variances;
  variances << 0.04, 0.04, 0.04, 0.09, 0.09, 0.09;
  EXPECT_TRUE(pose->twist_covariance.isApprox(Matrix6d{variances.asDiagonal()}));
}

TEST(RosMessages, TimeIsThatOfTheCaptureSince1970) {
  geoflow_pose pose = record(estimate());
  pose.realtime_minus_mono_ns = 1'700'000'000'000'000'000;
  EXPECT_EQ(make_ros_pose(pose, {})->t.count(), 1'700'000'050'000'000'000);
  pose.clock_flags = GEOFLOW_CLOCK_REPLAY | GEOFLOW_CLOCK_UNPACED;
  pose.t_recording_ns = 1'305'031'100'000'000'000;
  EXPECT_EQ(make_ros_pose(pose, {})->t.count(), 1'305'031'100'000'000'000);
}

TEST(RosMessages, WhereThereIsNoPoseNoneIsSaid) {
  geoflow_pose pose = record(estimate());
  for (const int status : {GEOFLOW_STARTING, GEOFLOW_INITIALISING, GEOFLOW_LOST}) {
    pose.status = static_cast<std::uint8_t>(status);
    EXPECT_FALSE(make_ros_pose(pose, {})) << status;
  }
  for (const int status : {GEOFLOW_TRACKING, GEOFLOW_DEGRADED, GEOFLOW_RELOCALISING}) {
    pose.status = static_cast<std::uint8_t>(status);
    EXPECT_TRUE(make_ros_pose(pose, {})) << status;
  }
}

TEST(RosMessages, DiagnosticsAreOfThePoseAndOfEachSource) {
  service::Observation seen{.pose = record(estimate()), .frames = 12};
  seen.sources = {{.name = "camera",
                   .health = {.state = SourceState::kStreaming, .reason = "", .delivered = 9}},
                  {.name = "imu", .health = {.state = SourceState::kDegraded, .reason = "late"}},
                  {.name = "legs", .health = {.state = SourceState::kFailed, .reason = "no can0"}},
                  {.name = "feet",
                   .health = {.state = SourceState::kStreaming, .reason = ""},
                   .silent = std::chrono::seconds{2}}};
  const auto diagnostics = make_diagnostics(seen, "TRACKING 30 Hz");
  ASSERT_EQ(diagnostics.size(), 5U);
  EXPECT_EQ(diagnostics[0].level, Level::kOk);
  EXPECT_EQ(diagnostics[0].message, "TRACKING 30 Hz");
  EXPECT_THAT(diagnostics[0].values, testing::Contains(testing::Pair("status", "TRACKING")));
  EXPECT_EQ(diagnostics[1].name, "geoflow: camera");
  EXPECT_EQ(diagnostics[1].level, Level::kOk);
  EXPECT_THAT(diagnostics[1].values, testing::Contains(testing::Pair("delivered", "9")));
  EXPECT_EQ(diagnostics[2].level, Level::kWarn);
  EXPECT_EQ(diagnostics[2].message, "late");
  EXPECT_EQ(diagnostics[3].level, Level::kError);
  EXPECT_EQ(diagnostics[4].level, Level::kStale);
  EXPECT_EQ(diagnostics[4].message, "silent");
  seen.pose->status = GEOFLOW_LOST;
  EXPECT_EQ(make_diagnostics(seen, "").front().level, Level::kError);
  seen.pose.reset();
  EXPECT_EQ(make_diagnostics(seen, "STARTING").front().level, Level::kWarn);
}

}  // namespace
}  // namespace geoflow::daemon::bus
