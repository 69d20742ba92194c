#include "geoflow/hal/leg_kinematics.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow {
namespace {

double forward_sign(Leg leg) noexcept {
  return leg == Leg::kFrontRight || leg == Leg::kFrontLeft ? 1.0 : -1.0;
}

double left_sign(Leg leg) noexcept {
  return leg == Leg::kFrontLeft || leg == Leg::kRearLeft ? 1.0 : -1.0;
}

/// The leg in its own plane, which the hip turns about x: forward (u) and up (w) from the thigh
/// joint, and the abduction link, signed.
struct LegPlane {
  double abad = 0;
  double u = 0;
  double w = 0;
  double calf_u = 0;  ///< the calf's share of u
  double calf_w = 0;
};

LegPlane leg_plane(const LegGeometry& geometry, Leg leg, const Vector3d& q) noexcept {
  LegPlane plane;
  plane.abad = left_sign(leg) * geometry.abad_m;
  plane.calf_u = -geometry.calf_m * std::sin(q.y() + q.z());
  plane.calf_w = -geometry.calf_m * std::cos(q.y() + q.z());
  plane.u = -geometry.thigh_m * std::sin(q.y()) + plane.calf_u;
  plane.w = -geometry.thigh_m * std::cos(q.y()) + plane.calf_w;
  return plane;
}

double wrapped(double angle) noexcept {
  return std::remainder(angle, 2 * std::numbers::pi);
}

/// Below this determinant [m^3] a leg is folded or stretched to within a millimetre of singular.
constexpr double kSingularDeterminant = 1e-6;

}  // namespace

Vector3d hip_position(const LegGeometry& geometry, Leg leg) noexcept {
  return {forward_sign(leg) * geometry.hip_x_m, left_sign(leg) * geometry.hip_y_m, 0};
}

Vector3d foot_position(const LegGeometry& geometry, Leg leg, const Vector3d& q_rad) noexcept {
  const LegPlane plane = leg_plane(geometry, leg, q_rad);
  const double sine = std::sin(q_rad.x());
  const double cosine = std::cos(q_rad.x());
  return hip_position(geometry, leg) + Vector3d{plane.u, plane.abad * cosine - plane.w * sine,
                                                plane.abad * sine + plane.w * cosine};
}

Matrix3d foot_jacobian(const LegGeometry& geometry, Leg leg, const Vector3d& q_rad) noexcept {
  const LegPlane plane = leg_plane(geometry, leg, q_rad);
  const double sine = std::sin(q_rad.x());
  const double cosine = std::cos(q_rad.x());
  Matrix3d J;
  J << 0, plane.w, plane.calf_w,                                                   //
      -plane.abad * sine - plane.w * cosine, plane.u * sine, plane.calf_u * sine,  //
      plane.abad * cosine - plane.w * sine, -plane.u * cosine, -plane.calf_u * cosine;
  return J;
}

std::optional<Vector3d> joint_angles(const LegGeometry& geometry, Leg leg,
                                     const Vector3d& foot_in_base) noexcept {
  const Vector3d p = foot_in_base - hip_position(geometry, leg);
  const double w2 = p.y() * p.y() + p.z() * p.z() - geometry.abad_m * geometry.abad_m;
  const double cosine_calf = (p.x() * p.x() + w2 - geometry.thigh_m * geometry.thigh_m -
                              geometry.calf_m * geometry.calf_m) /
                             (2 * geometry.thigh_m * geometry.calf_m);
  // Written so that NaN is refused as well.
  if (!(w2 > 0 && std::abs(cosine_calf) <= 1)) {
    return std::nullopt;
  }
  const double w = -std::sqrt(w2);
  const double calf = -std::acos(cosine_calf);
  const double hip = std::atan2(p.z(), p.y()) - std::atan2(w, left_sign(leg) * geometry.abad_m);
  const double thigh =
      std::atan2(-p.x(), -w) - std::atan2(geometry.calf_m * std::sin(calf),
                                          geometry.thigh_m + geometry.calf_m * std::cos(calf));
  return Vector3d{wrapped(hip), wrapped(thigh), calf};
}

Matrix3d calf_rotation(const Vector3d& q_rad) noexcept {
  return (Eigen::AngleAxisd{q_rad.x(), Vector3d::UnitX()} *
          Eigen::AngleAxisd{q_rad.y() + q_rad.z(), Vector3d::UnitY()})
      .toRotationMatrix();
}

Matrix3d calf_rate_jacobian(const Vector3d& q_rad) noexcept {
  const Vector3d knee{0, std::cos(q_rad.x()), std::sin(q_rad.x())};
  Matrix3d J;
  J << Vector3d::UnitX(), knee, knee;
  return J;
}

FootContact foot_contact(const LegGeometry& geometry, Leg leg, const Vector3d& q_rad,
                         const Vector3d& normal_in_base, double radius_m) noexcept {
  const Vector3d from_foot =
      calf_rotation(q_rad).col(0) * geometry.foot_offset_m - radius_m * normal_in_base;
  return {.point = foot_position(geometry, leg, q_rad) + from_foot,
          .jacobian =
              foot_jacobian(geometry, leg, q_rad) - skew(from_foot) * calf_rate_jacobian(q_rad)};
}

Vector3d base_velocity_from_stance(const FootContact& contact, const Vector3d& dq_radps,
                                   const Vector3d& w_base_radps) noexcept {
  return -(contact.jacobian * dq_radps + w_base_radps.cross(contact.point));
}

std::optional<Vector3d> ground_force(const Matrix3d& jacobian, const Vector3d& tau_nm) noexcept {
  if (!(std::abs(jacobian.determinant()) > kSingularDeterminant)) {
    return std::nullopt;
  }
  return Vector3d{-jacobian.transpose().inverse() * tau_nm};
}

LegJoints joints_of(const LegSample& sample, Leg leg) noexcept {
  LegJoints joints;
  for (std::size_t joint = 0; joint < kJointsPerLeg; ++joint) {
    const JointState& state = sample.joints[static_cast<std::size_t>(leg) * kJointsPerLeg + joint];
    const auto row = static_cast<Eigen::Index>(joint);
    joints.q_rad[row] = state.q_rad;
    joints.dq_radps[row] = state.dq_radps;
    joints.tau_nm[row] = state.tau_nm;
  }
  return joints;
}

}  // namespace geoflow
