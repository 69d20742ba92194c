#pragma once

#include <array>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {

/// Standard gravity [m/s^2], along -z of the world.
inline constexpr double kGravityMps2 = 9.80665;

/// Force and moment about the centre of mass, in world, that the ground must give for the body to
/// move as it does: its rigid-body inertia and weight.
struct Wrench {
  Vector3d force = Vector3d::Zero();         ///< [N]
  Vector3d moment = Vector3d::Zero();        ///< [Nm]
  Vector3d centre_world = Vector3d::Zero();  ///< the centre of mass [m]
};
[[nodiscard]] Wrench required_wrench(const BodyState& body);

/// Force of the ground on each foot, in world [N]. Their sum is `wrench.force` exactly; their
/// moment is `wrench.moment` as far as the feet on the ground allow (two feet cannot turn the body
/// about the line between them). A foot's share follows its load; no foot pulls unless the body as
/// a whole falls faster than free.
[[nodiscard]] std::array<Vector3d, kLegCount> support_forces(
    const Wrench& wrench, const std::array<FootState, kLegCount>& feet);

/// Mass of the robot [kg]: Unitree's URDF, with rotors. 157.8 N; a real Go2's standing torques say
/// 147.3 N, which is the same less the weight that the calves and feet carry themselves
/// (kLegMassKg).
inline constexpr double kRobotMassKg = 16.087;

/// Mass that each leg's torques move besides the body, as a point at the foot [kg]: that
/// difference, by four. Calf and foot weigh 0.194 kg in the URDF.
inline constexpr double kLegMassKg = 0.268;

}  // namespace geoflow::simulator
