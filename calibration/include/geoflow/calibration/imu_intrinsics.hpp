#pragma once

#include <span>
#include <vector>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// Scale, misalignment and bias of an accelerometer, and bias of a gyroscope, from a recording in
/// which the IMU lies still in many orientations. Pure functions, thread-safe.
///
/// At rest the true specific force is as long as gravity, in whatever direction: D. Tedaldi and
/// others, "A robust and easy to implement method for IMU calibration without external equipments",
/// ICRA 2014. No orientation need be known, and nothing need be level.
namespace geoflow::calibration {

/// What an accelerometer's reading must be corrected by: true = correction (reading - bias).
struct AccelIntrinsics {
  /// Upper triangular: scale on the diagonal, misalignment [rad] beside it. So the true frame has
  /// its z axis along the accelerometer's own and its y axis in the plane of y and z; lengths do
  /// not tell any other rotation.
  Matrix3d correction = Matrix3d::Identity();
  Vector3d bias_mps2 = Vector3d::Zero();
};

/// What a gyroscope says at rest: bias + per_accel * specific force.
struct GyroIntrinsics {
  Vector3d bias_radps = Vector3d::Zero();
  Matrix3d per_accel = Matrix3d::Zero();  ///< [rad/s per m/s^2]; how much it feels acceleration
};

/// A stretch of lying still: means over it.
struct ImuPose {
  HostTime begin{};
  Duration length{};
  ImuSample mean{};
  Vector3d accel_sigma_mps2 = Vector3d::Zero();  ///< of the mean, by the scatter of its parts
  Vector3d gyro_sigma_radps = Vector3d::Zero();
};

/// Parameters of the accelerometer in the order of `accel_covariance`.
inline constexpr int kAccelParameters = 9;

struct ImuIntrinsicsEstimate {
  std::vector<ImuPose> poses;
  AccelIntrinsics accel;
  /// Of correction's xx, yy, zz, xy, xz, yz, then the bias.
  Eigen::Matrix<double, kAccelParameters, kAccelParameters> accel_covariance =
      Eigen::Matrix<double, kAccelParameters, kAccelParameters>::Zero();
  GyroIntrinsics gyro;
  Vector3d gyro_bias_sigma_radps = Vector3d::Zero();
  Matrix3d gyro_per_accel_sigma = Matrix3d::Zero();
  std::vector<double> before_mps2;  ///< length of each pose's reading less gravity
  std::vector<double> after_mps2;   ///< the same of the corrected reading
  double rms_after_mps2 = 0;
};

struct ImuIntrinsicsOptions {
  // NOLINTBEGIN(readability-magic-numbers): named by the members
  double gravity_mps2 =
      9.80665;             ///< where it was recorded: 9.780 at the equator, 9.832 at the poles
  double min_still_s = 1;  ///< shorter rests are no poses
  // NOLINTEND(readability-magic-numbers)
};

/// Looks for the rests, and finds the parameters by least squares over them. Errors (kInvalidData):
/// samples that cannot be used; fewer than 12 poses; orientations that do not determine the
/// parameters, naming those that are missing.
[[nodiscard]] Result<ImuIntrinsicsEstimate> estimate_imu_intrinsics(
    std::span<const Timed<ImuSample>> samples, const ImuIntrinsicsOptions& options);

/// Every parameter with its verdict. PASS: scale to 0.1 %, misalignment to 0.1 degrees, bias to
/// 0.02 m/s^2 and 0.5 mrad/s, corrected lengths within 0.5 % of gravity (RMS).
[[nodiscard]] std::vector<Finding> judge(const ImuIntrinsicsEstimate& estimate,
                                         const ImuIntrinsicsOptions& options);

}  // namespace geoflow::calibration
