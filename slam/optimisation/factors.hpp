#pragma once

#include <array>

#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "geoflow/hal/geometry.hpp"

#include "inertial/gyro_turn.hpp"
#include "vision/camera_model.hpp"

/// Factors of bundle adjustment, one struct each, with analytic Jacobians.
///
/// A pose parameter is 7 doubles (qx qy qz qw, tx ty tz) of T_odom_cam, its tangent a right
/// perturbation, rotation first. The factors give derivatives by that tangent in the first six
/// columns and zero in the seventh: PoseManifold's PlusJacobian is [I; 0], so that Ceres's chain
/// rule takes them as they are and no quaternion derivative is computed.
namespace geoflow::slam {

inline constexpr int kPoseSize = 7;
inline constexpr int kPoseTangentSize = 6;
using PoseBlock = std::array<double, kPoseSize>;

[[nodiscard]] PoseBlock to_block(const SE3& T) noexcept;
[[nodiscard]] SE3 from_block(const double* block) noexcept;

/// See the head of this file.
class PoseManifold final : public ceres::Manifold {
 public:
  [[nodiscard]] int AmbientSize() const override { return kPoseSize; }
  [[nodiscard]] int TangentSize() const override { return kPoseTangentSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

/// Nearer than this a point has no usable projection: a step that leads there is refused [m].
constexpr double kMinimumDepthM = 1e-3;

/// Reprojection of a point (paper, equation (3)): (pi(T^-1 p) - u) / sigma; parameters: pose, point
/// (odom) [m].
class ReprojectionFactor final : public ceres::SizedCostFunction<2, kPoseSize, 3> {
 public:
  ReprojectionFactor(const CameraModel& camera, const Vector2d& pixel, double sigma_px)
      : camera_{camera}, pixel_{pixel}, sigma_px_{sigma_px} {}
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  CameraModel camera_;
  Vector2d pixel_;
  double sigma_px_;
};

/// Measured depth of a point: (1 / [T^-1 p]_z - 1 / z) / sigma; parameters: pose, point (odom) [m].
/// What a triangulating sensor errs by is the same at all depths in the inverse alone: weighed by a
/// sigma that grows with the measured z^2, depths that err towards the camera count for more.
class PointDepthFactor final : public ceres::SizedCostFunction<1, kPoseSize, 3> {
 public:
  PointDepthFactor(double depth_m, double sigma) : depth_m_{depth_m}, sigma_{sigma} {}
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double depth_m_;
  double sigma_;
};

/// A camera that feels which way is up: (R up_cam - up_odom) / sigma, of unit vectors, sigma an
/// angle [rad]; parameter: pose. It has two degrees of freedom; the third residual is of second
/// order.
class UprightFactor final : public ceres::SizedCostFunction<3, kPoseSize> {
 public:
  UprightFactor(const Vector3d& up_cam, const Vector3d& up_odom, double sigma_rad)
      : up_cam_{up_cam}, up_odom_{up_odom}, sigma_rad_{sigma_rad} {}
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Vector3d up_cam_;
  Vector3d up_odom_;
  double sigma_rad_;
};

/// Relative pose of two cameras (paper, equation (5)): W log(Z^-1 Ta^-1 Tb), with W^T W the
/// information of a right perturbation of Z = T_a_b; parameters: pose a, pose b.
class RelativePoseFactor final
    : public ceres::SizedCostFunction<kPoseTangentSize, kPoseSize, kPoseSize> {
 public:
  RelativePoseFactor(const SE3& T_a_b, const Matrix6d& information);
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  SE3 T_b_a_;
  Matrix6d W_;
};

/// The same of a motion that a gyroscope has told, whose bias is a third parameter: Z is turned by
/// exp(GyroTurn::correction(bias)) on the right.
class ReckonedFactor final
    : public ceres::SizedCostFunction<kPoseTangentSize, kPoseSize, kPoseSize, 3> {
 public:
  ReckonedFactor(const SE3& T_a_b, const Matrix6d& information, const GyroTurn& gyro);
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  SE3 T_a_b_;
  Matrix6d W_;
  GyroTurn gyro_;
};

/// A gyroscope's bias that wanders from one time to the next: (b - a) / sigma [rad/s]; parameters:
/// biases a, b.
class BiasWalkFactor final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit BiasWalkFactor(double sigma_radps) : sigma_radps_{sigma_radps} {}
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double sigma_radps_;
};

/// What is known of a bias beforehand: W (b - mean), with W^T W its information; parameter: b.
class BiasPriorFactor final : public ceres::SizedCostFunction<3, 3> {
 public:
  BiasPriorFactor(const Vector3d& mean_radps, const Matrix3d& covariance);
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Vector3d mean_radps_;
  Matrix3d W_;
};

}  // namespace geoflow::slam
