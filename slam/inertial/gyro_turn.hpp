#pragma once

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

/// The gyroscope's share in a motion from cam0 to cam1: how its rotation depends on the bias, which
/// images tell better than standing still did minutes ago. Biases are in the imu frame [rad/s].
struct GyroTurn {
  double duration_s = 0;  ///< 0: no gyroscope was heard
  /// Of a right perturbation of R_cam0_cam1, by the bias [s].
  Matrix3d per_bias = Matrix3d::Zero();
  /// What has been taken out of the rotation already, as per_bias times the biases assumed [rad].
  Vector3d taken_out = Vector3d::Zero();
  /// What was known of the bias at the motion's end.
  Vector3d bias = Vector3d::Zero();
  Matrix3d bias_covariance = Matrix3d::Zero();

  /// The right perturbation of R_cam0_cam1 that makes it the rotation with this bias instead [rad].
  [[nodiscard]] Vector3d correction(const Vector3d& by_bias) const {
    return per_bias * by_bias - taken_out;
  }
  /// One motion, and then another that turns cam1 into cam2 by R_cam1_cam2.
  [[nodiscard]] GyroTurn then(const GyroTurn& next, const Matrix3d& R_cam1_cam2) const {
    if (next.duration_s == 0) {
      return {};
    }
    return {.duration_s = duration_s + next.duration_s,
            .per_bias = R_cam1_cam2.transpose() * per_bias + next.per_bias,
            .taken_out = R_cam1_cam2.transpose() * taken_out + next.taken_out,
            .bias = next.bias,
            .bias_covariance = next.bias_covariance};
  }
};

}  // namespace geoflow::slam
