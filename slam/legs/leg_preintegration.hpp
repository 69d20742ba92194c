#pragma once

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "legs/leg_config.hpp"
#include "legs/stance_velocity.hpp"

/// A factor between two frames from the velocity that the legs give, turned by the gyroscope.
/// Source: Wisth, Camurri, Fallon, "VILENS: Visual, inertial, lidar, and leg odometry for
/// all-terrain legged robots", T-RO 2023, section on preintegrated velocity factors.
///
/// base0 and base1 are base at the two instants. The accelerometer has no part in it, so that the
/// factor can be weighed against the IMU.
namespace geoflow::slam {

/// What the legs say of the motion between two instants.
struct LegIncrement {
  HostTime t_begin;
  HostTime t_end;
  Vector3d dp = Vector3d::Zero();  ///< of base, in base0 [m]
  Matrix3d covariance = Matrix3d::Zero();
  Vector3d bias_gyro = Vector3d::Zero();         ///< at which it was integrated, in imu [rad/s]
  Matrix3d by_gyro_bias = Matrix3d::Zero();      ///< d dp / d bias_gyro [m s/rad]
  Matrix3d by_velocity_bias = Matrix3d::Zero();  ///< d dp / d bias_velocity [s]
  /// Share of the time in which at least one foot stood; the rest was bridged by the dead
  /// reckoning's velocity and is in the covariance as such [1].
  double contact = 0;
};

/// r = R_odom_base0^T (p_odom_base1 - p_odom_base0) - dp(bias_gyro, bias_velocity), with
/// derivatives by right perturbations (rotation, translation) of the two poses and by the biases.
/// `bias_velocity` is what the legs' velocity in base has too much: creep, scale, timing; a slow
/// random walk that only another sensor can find [m/s].
struct LegResidual {
  using ByPose = Eigen::Matrix<double, 3, 6>;
  Vector3d value = Vector3d::Zero();
  ByPose by_first = ByPose::Zero();
  ByPose by_second = ByPose::Zero();
  Matrix3d by_gyro_bias = Matrix3d::Zero();
  Matrix3d by_velocity_bias = Matrix3d::Zero();
};

/// Pure. The residual's covariance is `measured.covariance`.
[[nodiscard]] LegResidual leg_residual(const LegIncrement& measured, const SE3& T_odom_base0,
                                       const SE3& T_odom_base1, const Vector3d& bias_gyro,
                                       const Vector3d& bias_velocity);

/// What one step is integrated with.
struct LegStep {
  double dt_s = 0;
  Vector3d gyro_radps = Vector3d::Zero();        ///< mean over the step, in imu, as measured
  VelocityBelief velocity;                       ///< computed with the turn that `bias_gyro` leaves
  Matrix3d velocity_by_turn = Matrix3d::Zero();  ///< d velocity / d w_base [m]
  /// Time between the samples that `velocity` comes from, over which its noise is one draw [s].
  double sample_s = 0;
  bool contact = false;
};

/// Builds LegIncrements step by step. Thread-compatible.
class LegPreintegrator {
 public:
  explicit LegPreintegrator(const LegConfig& config);

  void begin(HostTime t, const Vector3d& bias_gyro);
  void add(const LegStep& step);
  [[nodiscard]] LegIncrement increment(HostTime t_end) const;

 private:
  Matrix3d R_base_imu_;
  LegNoise noise_;
  double gyro_density_;

  LegIncrement sum_;
  Eigen::Quaterniond q_base0_base_ = Eigen::Quaterniond::Identity();
  /// Of (rotation, as a right perturbation, and dp).
  Matrix6d covariance_ = Matrix6d::Zero();
  Matrix3d rotation_by_bias_ = Matrix3d::Zero();  ///< in base
  Matrix3d dp_by_bias_ = Matrix3d::Zero();        ///< in base
  double duration_s_ = 0;
  double contact_s_ = 0;
};

}  // namespace geoflow::slam
