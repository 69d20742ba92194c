#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "odometry/pose_optimiser.hpp"

namespace geoflow::slam {

/// Constant velocity with white-noise acceleration: the last resort of the paper's order (section
/// IV-B), and the prior that holds directions in which nothing is seen. Thread-compatible.
class MotionModel {
 public:
  /// Takes over a tracked pose. `trusted`: whether something was seen that fixes it; if not, the
  /// velocity is kept.
  void update(HostTime t, const SE3& T_odom_cam, bool trusted);

  /// The pose expected at `t` with its information. Beyond kMemory the velocity says nothing any
  /// more and fades: after a gap the camera is as likely to have stopped.
  [[nodiscard]] PosePrior predict(HostTime t) const;

  /// The pose of the camera at a time near the last update, by its velocity.
  [[nodiscard]] SE3 motion_over(Duration duration) const;

  /// Moves the last pose with the map: left-multiplies it.
  void move(const SE3& T_odom1_odom0);

  /// Velocity of the camera in its own frame (rotation, translation) [rad/s, m/s].
  [[nodiscard]] const Vector6d& velocity() const noexcept { return velocity_; }

 private:
  HostTime t_;
  SE3 T_odom_cam_;
  Vector6d velocity_ = Vector6d::Zero();
};

}  // namespace geoflow::slam
