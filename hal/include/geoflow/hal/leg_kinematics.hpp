#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

/// Kinematics of a three-joint leg (hip abduction about +x, thigh and calf about +y) as Unitree's
/// quadrupeds have it. Pure functions, thread-safe.
///
/// - base: x forward, y left, z up, at the middle of the four hip joints. At angles zero a leg
/// hangs
///   straight down and all joint frames are parallel to base.
/// - Angles, rates and torques of a leg are 3 x 1 (hip, thigh, calf) with the signs of Unitree's
/// SDK.
/// - Points are in base [m]; Jacobians are 3 x 3 [m/rad], columns hip, thigh, calf.
namespace geoflow {

/// The lengths of one robot's legs; left and right, front and rear mirror each other.
struct LegGeometry {
  double hip_x_m = 0;        ///< hip joint from base, forwards at the front, backwards at the rear
  double hip_y_m = 0;        ///< hip joint from base, outwards
  double abad_m = 0;         ///< hip joint to thigh joint, outwards
  double thigh_m = 0;        ///< thigh joint to calf joint
  double calf_m = 0;         ///< calf joint to foot frame
  double foot_radius_m = 0;  ///< of the sphere that touches the ground
  /// The sphere's centre from the foot frame, along the calf's x axis.
  double foot_offset_m = 0;

  friend bool operator==(const LegGeometry&, const LegGeometry&) = default;
};

// NOLINTBEGIN(readability-magic-numbers): lengths, each named and given its unit by its member

/// Unitree Go2. Source: unitree_ros, robots/go2_description/urdf/go2_description.urdf.
inline constexpr LegGeometry kGo2Legs{.hip_x_m = 0.1934,
                                      .hip_y_m = 0.0465,
                                      .abad_m = 0.0955,
                                      .thigh_m = 0.213,
                                      .calf_m = 0.213,
                                      .foot_radius_m = 0.022,
                                      .foot_offset_m = -0.002};

/// Unitree Go1. Source: unitree_ros, robots/go1_description/xacro/const.xacro.
inline constexpr LegGeometry kGo1Legs{.hip_x_m = 0.1881,
                                      .hip_y_m = 0.04675,
                                      .abad_m = 0.08,
                                      .thigh_m = 0.213,
                                      .calf_m = 0.213,
                                      .foot_radius_m = 0.02,
                                      .foot_offset_m = 0};

// NOLINTEND(readability-magic-numbers)

/// The hip joint's place in base.
[[nodiscard]] Vector3d hip_position(const LegGeometry& geometry, Leg leg) noexcept;

/// Forward kinematics: the foot frame's origin in base.
[[nodiscard]] Vector3d foot_position(const LegGeometry& geometry, Leg leg,
                                     const Vector3d& q_rad) noexcept;

/// d foot_position / d q. Singular when the leg is straight (calf 0) and when the foot lies on the
/// hip's axis.
[[nodiscard]] Matrix3d foot_jacobian(const LegGeometry& geometry, Leg leg,
                                     const Vector3d& q_rad) noexcept;

/// Inverse kinematics in closed form for the posture that Unitree's robots walk in: knee backwards
/// (calf angle <= 0), foot below the hip. `foot_position` of the answer is the point given. Angles
/// lie in (-pi, pi]; joint limits are not looked at. None where the leg does not reach.
[[nodiscard]] std::optional<Vector3d> joint_angles(const LegGeometry& geometry, Leg leg,
                                                   const Vector3d& foot_in_base) noexcept;

/// Rotation from the calf's frame (z along the calf, upwards) to base.
[[nodiscard]] Matrix3d calf_rotation(const Vector3d& q_rad) noexcept;

/// `calf_rate_jacobian(q) * dq` is the calf's angular velocity relative to base, in base [rad/s].
[[nodiscard]] Matrix3d calf_rate_jacobian(const Vector3d& q_rad) noexcept;

/// A point of the calf that is about to touch the ground, and how it moves with the joints.
struct FootContact {
  Vector3d point = Vector3d::Zero();     ///< in base
  Matrix3d jacobian = Matrix3d::Zero();  ///< of the material point that is at `point` now
};

/// The lowest point of the foot's sphere over ground with unit normal `normal_in_base`, the sphere
/// taken with `radius_m` (a soft foot rolls on less than its geometric radius; zero is the sphere's
/// centre). As the sphere rolls, the material point that touches is at rest, the foot frame is not:
/// "the foot frame stands still" underestimates a trot's distance by 3 to 9 percent.
[[nodiscard]] FootContact foot_contact(const LegGeometry& geometry, Leg leg, const Vector3d& q_rad,
                                       const Vector3d& normal_in_base, double radius_m) noexcept;

/// The base's velocity, in base [m/s], if the material point `contact` rests on the ground (rolls
/// without slip) while the joints turn with `dq_radps` and base turns with `w_base_radps` (in
/// base).
[[nodiscard]] Vector3d base_velocity_from_stance(const FootContact& contact,
                                                 const Vector3d& dq_radps,
                                                 const Vector3d& w_base_radps) noexcept;

/// What the ground pushes on the foot, in base [N], when the joints hold `tau_nm` and the leg's own
/// weight and inertia are left out (a few newtons on a standing Go2): -J^-T tau. None where the
/// Jacobian is singular.
[[nodiscard]] std::optional<Vector3d> ground_force(const Matrix3d& jacobian,
                                                   const Vector3d& tau_nm) noexcept;

/// One leg's angles [rad], rates [rad/s] and torques [Nm] of a sample.
struct LegJoints {
  Vector3d q_rad = Vector3d::Zero();
  Vector3d dq_radps = Vector3d::Zero();
  Vector3d tau_nm = Vector3d::Zero();
};
[[nodiscard]] LegJoints joints_of(const LegSample& sample, Leg leg) noexcept;

}  // namespace geoflow
