#include "geoflow/tools/simulator/support_forces.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include <Eigen/Cholesky>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {
namespace {

/// The centre of mass in base: where a standing Go2's foot forces (42.1, 43.6, 31.2, 30.5 N)
/// balance.
constexpr double kCentreOfMassXM = 0.012;

/// Moments of inertia [kg m^2]: the URDF's base, and the four hips and thighs as 1.9 kg each at
/// (0.19, 0.12, -0.05) of base.
constexpr double kInertiaXx = 0.153;
constexpr double kInertiaYy = 0.391;
constexpr double kInertiaZz = 0.491;

/// How unwilling the feet are to make a moment rather than carry by their loads [m^2]: small
/// against the square of half the track.
constexpr double kMomentSlack = 1e-3;

/// A foot keeps at least this part of its share by load.
constexpr double kLeastShare = 0.1;

using Wrenches = Eigen::Matrix<double, 6, 3>;

/// What a force on a foot is to the body: itself and its moment.
Wrenches wrench_of_force(const FootState& foot, const Vector3d& centre_world) {
  Vector3d arm = foot.p_world - centre_world;
  arm.z() -= kGo2Legs.foot_radius_m;
  Wrenches wrenches;
  wrenches << Matrix3d::Identity(), skew(arm);
  return wrenches;
}

}  // namespace

Wrench required_wrench(const BodyState& body) {
  const Matrix3d R_world_base = body.T_world_base.rotation_matrix();
  const Vector3d p_base_centre{kCentreOfMassXM, 0, 0};
  const Vector3d inertia{kInertiaXx, kInertiaYy, kInertiaZz};
  const Vector3d& w = body.w_base;
  const Vector3d accel = body.a_world_base + R_world_base * (body.alpha_base.cross(p_base_centre) +
                                                             w.cross(w.cross(p_base_centre)));
  const Vector3d moment =
      inertia.cwiseProduct(body.alpha_base) + w.cross(inertia.cwiseProduct(w).eval());
  return {.force = kRobotMassKg * (accel + kGravityMps2 * Vector3d::UnitZ()),
          .moment = R_world_base * moment,
          .centre_world = body.T_world_base * p_base_centre};
}

std::array<Vector3d, kLegCount> support_forces(const Wrench& wrench,
                                               const std::array<FootState, kLegCount>& feet) {
  std::array<Vector3d, kLegCount> forces{};
  double load = 0;
  for (const FootState& foot : feet) {
    load += foot.load;
  }
  forces.fill(Vector3d::Zero());
  if (load <= 0) {
    return forces;
  }
  // The least forces, weighted by load, with sum and moment as asked: W A^T (A W A^T + slack)^-1 b.
  Matrix6d normal = Matrix6d::Zero();
  normal.diagonal().tail<3>().setConstant(kMomentSlack);
  for (const FootState& foot : feet) {
    const Wrenches A = wrench_of_force(foot, wrench.centre_world);
    normal += foot.load / load * (A * A.transpose());
  }
  Vector6d wanted;
  wanted << wrench.force, wrench.moment;
  const Vector6d multipliers = normal.ldlt().solve(wanted);

  // Where that would make a foot pull, as much of the plain split by load as prevents it.
  double kept = 1;
  for (std::size_t i = 0; i < kLegCount; ++i) {
    const double share = feet[i].load / load;
    forces[i] = share * wrench_of_force(feet[i], wrench.centre_world).transpose() * multipliers;
    const double plain = share * wrench.force.z();
    const double least = kLeastShare * plain;
    if (forces[i].z() < least && plain > least) {
      kept = std::min(kept, (plain - least) / (plain - forces[i].z()));
    }
  }
  for (std::size_t i = 0; i < kLegCount; ++i) {
    forces[i] = kept * forces[i] + (1 - kept) * feet[i].load / load * wrench.force;
  }
  return forces;
}

}  // namespace geoflow::simulator
