#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "odometry/dead_reckoner.hpp"
#include "odometry/pose_optimiser.hpp"

namespace geoflow::slam {

/// Whether a prediction is so uncertain that it is no start for following features.
[[nodiscard]] bool is_blind(const PosePrior& prior);

/// Constant velocity with white-noise acceleration: the last resort of the paper's order (section
/// IV-B), and the prior that holds directions in which nothing is seen. Thread-compatible.
class MotionModel {
 public:
  /// Takes over a tracked pose. `followed`: whether its way from the one before is known by
  /// something seen or by legs; if not, the velocity fades, and the way is as uncertain as the time
  /// since. `covariance`: of a right perturbation of the pose.
  void update(HostTime t, const SE3& T_odom_cam, const Matrix6d& covariance, bool followed);

  /// The pose expected at `t` with its information: by `motion` since the last update, in so far as
  /// it knows better than constant velocity. Beyond kMemory the velocity says nothing any more and
  /// fades: after a gap the camera is as likely to have stopped.
  [[nodiscard]] PosePrior predict(HostTime t,
                                  const std::optional<ReckonedMotion>& motion = std::nullopt) const;

  /// The pose of the camera at a time near the last update, by its velocity.
  [[nodiscard]] SE3 motion_over(Duration duration) const;

  /// Moves the last pose with the map: left-multiplies it.
  void move(const SE3& T_odom1_odom0);

  /// Velocity of the camera in its own frame (rotation, translation) [rad/s, m/s].
  [[nodiscard]] const Vector6d& velocity() const noexcept { return velocity_; }

 private:
  HostTime t_;
  HostTime t_followed_;  ///< of the last update that followed
  SE3 T_odom_cam_;
  /// Of T_odom_cam_; its way only as far as the last pose that followed.
  Matrix6d covariance_ = Matrix6d::Zero();
  Vector6d velocity_ = Vector6d::Zero();
};

}  // namespace geoflow::slam
