#pragma once

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

/// Which way is up, as an accelerometer tells it in whatever way it moves: what keeps a map
/// upright. Most of its error is the accelerometer's bias, which is much the same all the time:
/// directions felt with one heading share it, and it is found out with the first turn.
struct UpDirection {
  Vector3d up = Vector3d::UnitZ();  ///< unit vector in some sensor's frame
  double variance = 0;  ///< of its angle about an axis across it, were the bias known [rad^2]
  Matrix3d per_bias = Matrix3d::Zero();  ///< of `up`, by the bias [s^2/m]
  Vector3d bias = Vector3d::Zero();      ///< that was assumed, in the imu frame [m/s^2]
  Matrix3d bias_covariance = Matrix3d::Zero();

  /// The same with another bias.
  [[nodiscard]] Vector3d given(const Vector3d& other_bias) const {
    return (up + per_bias * (other_bias - bias)).normalized();
  }
  /// In a frame in which the sensor has this rotation.
  [[nodiscard]] UpDirection seen_from(const Matrix3d& R_frame_sensor) const {
    UpDirection turned = *this;
    turned.up = R_frame_sensor * up;
    turned.per_bias = R_frame_sensor * per_bias;
    return turned;
  }
};

}  // namespace geoflow::slam
