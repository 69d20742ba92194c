#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

/// Rotations and rigid transforms, and the one statement of this project's conventions.
///
/// - `T_a_b` maps coordinates in b to coordinates in a: `p_a = T_a_b * p_b`; inner names of
/// products cancel
///   (`T_a_c = T_a_b * T_b_c`). `R_a_b` is its rotation, `p_a_b` its translation: the position of
///   b's origin in a.
/// - A tangent vector is (rotation, translation) [rad, m], in that order, 6 x 1.
/// - Perturbations act on the right: `T = T_mean * SE3::exp(xi)`, so xi lives in the frame b of
/// T_a_b.
/// - A pose covariance is E[xi xi^T], 6 x 6, in that order and frame.
/// - Frames: map -> odom -> base_link (REP-105: x forward, y left, z up) and cam, the colour
/// camera's optical frame
///   (x right, y down, z forward); imu is the camera's IMU.
namespace geoflow {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The skew matrix of v: `skew(v) * w == v.cross(w)`.
[[nodiscard]] Matrix3d skew(const Vector3d& v) noexcept;

/// Functions of the rotation group SO(3), 3 x 3 rotation vectors in rad. Pure, thread-safe.
/// Source: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, eq.
/// (132)-(148).
namespace so3 {

/// The rotation by |phi| about phi / |phi|, exact to first order at zero.
[[nodiscard]] Eigen::Quaterniond exp(const Vector3d& phi) noexcept;

/// The rotation vector of q with angle in [0, pi]; q and -q give the same.
[[nodiscard]] Vector3d log(const Eigen::Quaterniond& q) noexcept;

/// `exp(phi + d) = exp(phi) * exp(right_jacobian(phi) * d)` to first order in d.
[[nodiscard]] Matrix3d right_jacobian(const Vector3d& phi) noexcept;
[[nodiscard]] Matrix3d right_jacobian_inverse(const Vector3d& phi) noexcept;

}  // namespace so3

/// A rigid transform. Conventions above. A value type; thread-compatible.
class SE3 {
 public:
  SE3() noexcept : rotation_{Eigen::Quaterniond::Identity()}, translation_{Vector3d::Zero()} {}

  /// Normalises the rotation.
  SE3(const Eigen::Quaterniond& rotation, const Vector3d& translation) noexcept
      : rotation_{rotation.normalized()}, translation_{translation} {}

  /// From the nearest rotation to a 3 x 3 matrix that is a rotation up to rounding.
  SE3(const Matrix3d& rotation, const Vector3d& translation) noexcept
      : SE3{Eigen::Quaterniond{rotation}, translation} {}

  [[nodiscard]] const Eigen::Quaterniond& rotation() const noexcept { return rotation_; }
  [[nodiscard]] Matrix3d rotation_matrix() const noexcept { return rotation_.toRotationMatrix(); }
  [[nodiscard]] const Vector3d& translation() const noexcept { return translation_; }

  /// 4 x 4 homogeneous matrix.
  [[nodiscard]] Eigen::Matrix4d matrix() const noexcept;

  [[nodiscard]] SE3 inverse() const noexcept;
  [[nodiscard]] SE3 operator*(const SE3& other) const noexcept;
  [[nodiscard]] Vector3d operator*(const Vector3d& point) const noexcept {
    return rotation_ * point + translation_;
  }

  /// The exponential of a tangent (rotation, translation) [rad, m] and its inverse.
  [[nodiscard]] static SE3 exp(const Vector6d& xi) noexcept;
  [[nodiscard]] Vector6d log() const noexcept;

  /// `T * exp(xi) * T^-1 == exp(T.adjoint() * xi)`.
  [[nodiscard]] Matrix6d adjoint() const noexcept;

  /// `exp(xi + d) = exp(xi) * exp(right_jacobian(xi) * d)` to first order in d; and the inverse of
  /// that matrix.
  [[nodiscard]] static Matrix6d right_jacobian(const Vector6d& xi) noexcept;
  [[nodiscard]] static Matrix6d right_jacobian_inverse(const Vector6d& xi) noexcept;

  /// The point on the geodesic from `a` (ratio 0) to `b` (ratio 1); extrapolates outside.
  [[nodiscard]] static SE3 interpolate(const SE3& a, const SE3& b, double ratio) noexcept;

 private:
  Eigen::Quaterniond rotation_;
  Vector3d translation_;
};

}  // namespace geoflow
