#include "geoflow/hal/geometry.hpp"

#include <cmath>

namespace geoflow {
namespace {

/// Below this angle [rad] the closed forms lose digits and their Taylor series are exact to
/// rounding.
constexpr double kSmallAngle = 1e-4;

/// The mixed block of SE(3)'s left Jacobian. Source: Barfoot, "State Estimation for Robotics",
/// 2017, eq. (7.86).
Matrix3d left_jacobian_mixed_block(const Vector3d& phi, const Vector3d& rho) noexcept {
  const double angle = phi.norm();
  const double angle2 = angle * angle;
  // The Taylor series of a, b and c.
  constexpr double kA0 = 1.0 / 6;
  constexpr double kA2 = 1.0 / 120;
  constexpr double kB0 = 1.0 / 24;
  constexpr double kB2 = 1.0 / 720;
  constexpr double kC0 = 1.0 / 120;
  constexpr double kC2 = 1.0 / 2520;
  double a = kA0 - angle2 * kA2;
  double b = kB0 - angle2 * kB2;
  double c = kC0 - angle2 * kC2;
  constexpr double kSeriesAngle = 1e-2;  // the closed form of c divides by angle^5
  if (angle > kSeriesAngle) {
    const double sine = std::sin(angle);
    const double cosine = std::cos(angle);
    a = (angle - sine) / (angle2 * angle);
    b = (angle2 / 2 + cosine - 1) / (angle2 * angle2);
    c = (2 * angle - 3 * sine + angle * cosine) / (2 * angle2 * angle2 * angle);
  }
  const Matrix3d P = skew(phi);
  const Matrix3d Q = skew(rho);
  return 0.5 * Q + a * (P * Q + Q * P + P * Q * P) + b * (P * P * Q + Q * P * P - 3 * P * Q * P) +
         c * (P * Q * P * P + P * P * Q * P);
}

}  // namespace

Matrix3d skew(const Vector3d& v) noexcept {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

namespace so3 {

Eigen::Quaterniond exp(const Vector3d& phi) noexcept {
  const double angle = phi.norm();
  const double half_sinc =
      angle < kSmallAngle ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  const Vector3d v = half_sinc * phi;
  return Eigen::Quaterniond{std::cos(angle / 2), v.x(), v.y(), v.z()};
}

Vector3d log(const Eigen::Quaterniond& q) noexcept {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const double norm = q.vec().norm();
  if (norm < kSmallAngle) {
    const double w = sign * q.w();
    return sign * (2 / w) * (1 - norm * norm / (3 * w * w)) * q.vec();
  }
  return sign * 2 * std::atan2(norm, sign * q.w()) / norm * q.vec();
}

Matrix3d right_jacobian(const Vector3d& phi) noexcept {
  const double angle = phi.norm();
  const Matrix3d W = skew(phi);
  if (angle < kSmallAngle) {
    return Matrix3d::Identity() - 0.5 * W + W * W / 6;
  }
  const double angle2 = angle * angle;
  return Matrix3d::Identity() - (1 - std::cos(angle)) / angle2 * W +
         (angle - std::sin(angle)) / (angle2 * angle) * W * W;
}

Matrix3d right_jacobian_inverse(const Vector3d& phi) noexcept {
  const double angle = phi.norm();
  const Matrix3d W = skew(phi);
  if (angle < kSmallAngle) {
    constexpr double kSecondOrder = 1.0 / 12;
    return Matrix3d::Identity() + 0.5 * W + kSecondOrder * W * W;
  }
  const double half_cot = 0.5 * std::cos(angle / 2) / std::sin(angle / 2);
  return Matrix3d::Identity() + 0.5 * W + (1 - angle * half_cot) / (angle * angle) * W * W;
}

}  // namespace so3

Eigen::Matrix4d SE3::matrix() const noexcept {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation_matrix();
  m.topRightCorner<3, 1>() = translation_;
  return m;
}

SE3 SE3::inverse() const noexcept {
  const Eigen::Quaterniond inverse = rotation_.conjugate();
  return SE3{inverse, -(inverse * translation_)};
}

SE3 SE3::operator*(const SE3& other) const noexcept {
  return SE3{rotation_ * other.rotation_, rotation_ * other.translation_ + translation_};
}

SE3 SE3::exp(const Vector6d& xi) noexcept {
  const Vector3d phi = xi.head<3>();
  return SE3{so3::exp(phi), so3::right_jacobian(-phi) * xi.tail<3>()};
}

Vector6d SE3::log() const noexcept {
  const Vector3d phi = so3::log(rotation_);
  Vector6d xi;
  xi << phi, so3::right_jacobian_inverse(-phi) * translation_;
  return xi;
}

Matrix6d SE3::adjoint() const noexcept {
  const Matrix3d R = rotation_matrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomLeftCorner<3, 3>() = skew(translation_) * R;
  adjoint.bottomRightCorner<3, 3>() = R;
  return adjoint;
}

Matrix6d SE3::right_jacobian(const Vector6d& xi) noexcept {
  const Vector3d phi = -xi.head<3>();
  const Matrix3d J = so3::right_jacobian(xi.head<3>());
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = J;
  jacobian.bottomLeftCorner<3, 3>() = left_jacobian_mixed_block(phi, -xi.tail<3>());
  jacobian.bottomRightCorner<3, 3>() = J;
  return jacobian;
}

Matrix6d SE3::right_jacobian_inverse(const Vector6d& xi) noexcept {
  const Vector3d phi = -xi.head<3>();
  const Matrix3d J = so3::right_jacobian_inverse(xi.head<3>());
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = J;
  jacobian.bottomLeftCorner<3, 3>() = -J * left_jacobian_mixed_block(phi, -xi.tail<3>()) * J;
  jacobian.bottomRightCorner<3, 3>() = J;
  return jacobian;
}

SE3 SE3::interpolate(const SE3& a, const SE3& b, double ratio) noexcept {
  return a * exp(ratio * (a.inverse() * b).log());
}

}  // namespace geoflow
