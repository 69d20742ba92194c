#include "odometry/row_timing.hpp"

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"

#include "odometry/frame.hpp"
#include "odometry/pose_optimiser.hpp"
#include "vision/row_time.hpp"

namespace geoflow::slam {

RowTiming::RowTiming(const Switches& switches, const Calibration& calibration)
    : camera_{calibration.camera} {
  if (switches.rolling_shutter && switches.imu) {
    T_cam_imu_ = calibration.T_cam_imu;
  }
}

void RowTiming::begin_frame(const SyncedPacket& packet) {
  constexpr Duration kAround = std::chrono::milliseconds{10};
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  for (const Timed<ImuSample>& sample : packet.imu) {
    if (sample.t >= packet.t - kAround && sample.sample.gyro_radps.allFinite()) {
      sum += sample.sample.gyro_radps;
      ++count;
    }
  }
  w_cam_.reset();
  if (T_cam_imu_ && count > 0) {
    w_cam_ = T_cam_imu_->rotation() * (sum / count);
  }
}

std::optional<RowMotion> RowTiming::motion(const Frame& previous, HostTime t,
                                           const SE3& T_odom_cam_predicted) const {
  constexpr double kLongest_s = 0.2;
  const double dt = to_seconds(t - previous.t);
  if (!w_cam_ || !(dt > 0 && dt < kLongest_s)) {
    return std::nullopt;
  }
  RowMotion rows{.twist = (previous.T_odom_cam.inverse() * T_odom_cam_predicted).log() / dt,
                 .readout_s = readout_.seconds()};
  rows.twist.head<3>() = *w_cam_;
  return rows;
}

void RowTiming::learn(const Frame& frame, std::span<const VisualMatch> matches,
                      const std::vector<std::size_t>& feature_of_match,
                      const PoseSolution& solution) {
  if (frame.rows.twist == Vector6d::Zero()) {
    return;
  }
  std::vector<ReadoutEstimate::Feature> features;
  const SE3 T_cam_odom = solution.T_odom_cam.inverse();
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const VisualMatch& match = matches[k];
    const Vector3d p_cam = T_cam_odom * match.p_odom;
    if (!solution.inlier[k] || p_cam.z() <= 0) {
      continue;
    }
    Eigen::Matrix<double, 3, 6> point_by_pose;
    point_by_pose << skew(p_cam), -Matrix3d::Identity();
    const double row = frame.features[feature_of_match[k]].raw.y();
    features.push_back({.shift = row_shift(camera_, frame.rows.twist, match.pixel, row, p_cam.z()),
                        .residual = camera_.project(p_cam) - match.pixel,
                        .by_pose = camera_.project_jacobian(p_cam) * point_by_pose});
  }
  readout_.add(features, solution.pixel_sigma);
}

}  // namespace geoflow::slam
