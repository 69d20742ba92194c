#include "geoflow/tools/simulator/support_forces.hpp"

#include <array>
#include <cstddef>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {
namespace {

/// The centre of mass in base: where a standing Go2's foot forces (42.1, 43.6, 31.2, 30.5 N)
/// balance.
constexpr double kCentreOfMassXM = 0.012;

/// What part of the weight the front feet carry, of the same forces.
constexpr double kFrontShare = 0.58;

/// Each foot's part of the load; all 0 when no foot carries.
std::array<double, kLegCount> shares(const std::array<FootState, kLegCount>& feet) {
  std::array<double, kLegCount> shares{};
  double sum = 0;
  for (const Leg leg : kAllLegs) {
    const bool front = leg == Leg::kFrontRight || leg == Leg::kFrontLeft;
    const auto l = static_cast<std::size_t>(leg);
    shares.at(l) = feet.at(l).load * (front ? kFrontShare : 1 - kFrontShare);
    sum += shares.at(l);
  }
  for (double& share : shares) {
    share = sum > 0 ? share / sum : 0;
  }
  return shares;
}

}  // namespace

Vector3d required_force(const BodyState& body) {
  const Matrix3d R_world_base = body.T_world_base.rotation_matrix();
  const Vector3d p_base_centre{kCentreOfMassXM, 0, 0};
  const Vector3d& w = body.w_base;
  const Vector3d accel = body.a_world_base + R_world_base * (body.alpha_base.cross(p_base_centre) +
                                                             w.cross(w.cross(p_base_centre)));
  return kRobotMassKg * (accel + kGravityMps2 * Vector3d::UnitZ());
}

std::array<Vector3d, kLegCount> support_forces(const Vector3d& force_world,
                                               const std::array<FootState, kLegCount>& feet) {
  const std::array<double, kLegCount> by_foot = shares(feet);
  std::array<Vector3d, kLegCount> forces{};
  for (std::size_t i = 0; i < kLegCount; ++i) {
    forces.at(i) = by_foot.at(i) * force_world;
  }
  return forces;
}

}  // namespace geoflow::simulator
