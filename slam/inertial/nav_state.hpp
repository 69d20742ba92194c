#pragma once

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

/// The inertial state and its tangent.
///
/// A tangent vector of `NavState` has 15 entries (rotation, translation, velocity, gyro bias, accel
/// bias): a right perturbation of T_odom_imu as in hal/geometry.hpp, then differences. Covariances,
/// Jacobians and residuals of this room are in that order. Values; no function here keeps a state,
/// so all are thread-safe.
namespace geoflow::slam {

/// Where each part of a state's tangent begins, and its size.
inline constexpr int kRotationAt = 0;
inline constexpr int kTranslationAt = 3;
inline constexpr int kVelocityAt = 6;
inline constexpr int kGyroBiasAt = 9;
inline constexpr int kAccelBiasAt = 12;
inline constexpr int kMotionSize = 9;  ///< rotation, translation, velocity
inline constexpr int kBiasSize = 6;    ///< gyro, accel
inline constexpr int kStateSize = 15;

using StateVector = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;
using BiasMatrix = Eigen::Matrix<double, kBiasSize, kBiasSize>;

/// Magnitude of gravity [m/s^2]: the standard acceleration (ISO 80000-3). It differs from place to
/// place by +-0.3 %, which is below a MEMS accelerometer's offset.
inline constexpr double kStandardGravity = 9.80665;

/// Gravity in an odom frame whose z points up [m/s^2]: the acceleration of a falling body.
[[nodiscard]] inline Vector3d gravity_down() {
  return {0, 0, -kStandardGravity};
}

/// What the IMU says too much: measured = true + bias + noise.
struct ImuBias {
  Vector3d gyro_radps = Vector3d::Zero();
  Vector3d accel_mps2 = Vector3d::Zero();

  /// (gyro, accel), 6 x 1.
  [[nodiscard]] Vector6d vector() const;
  [[nodiscard]] static ImuBias from(const Vector6d& v) {
    return {.gyro_radps = v.head<3>(), .accel_mps2 = v.tail<3>()};
  }
};

/// Pose, velocity and biases of the IMU at one instant.
struct NavState {
  SE3 T_odom_imu;
  Vector3d v_odom = Vector3d::Zero();  ///< velocity of the imu frame's origin in odom [m/s]
  ImuBias bias{};

  /// The state moved by a tangent vector; and the vector by which `other` is moved to `*this`.
  [[nodiscard]] NavState plus(const StateVector& delta) const;
  [[nodiscard]] StateVector minus(const NavState& other) const;
};

}  // namespace geoflow::slam
