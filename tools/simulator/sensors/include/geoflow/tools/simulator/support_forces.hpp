#pragma once

#include <array>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {

/// Standard gravity [m/s^2], along -z of the world.
inline constexpr double kGravityMps2 = 9.80665;

/// The force, in world [N], that the ground must give for the body's centre of mass to move as it
/// does: its inertia and weight.
[[nodiscard]] Vector3d required_force(const BodyState& body);

/// Force of the ground on each foot, in world [N]: `force_world` split as a standing Go2's feet
/// split its weight, times each foot's load. The moment of these forces is not what the prescribed
/// body turns by. A body that is made to turn so does not yield when the feet wander backwards
/// under it, as a real one does: to balance that moment, two thirds of the load would move from the
/// rear foot to the front one within each stance, where in a physics simulation of the same trot
/// (MuJoCo, Unitree's model of the Go2) a foot's part changes by less than a tenth, and real feet
/// rise alike in front and behind.
[[nodiscard]] std::array<Vector3d, kLegCount> support_forces(
    const Vector3d& force_world, const std::array<FootState, kLegCount>& feet);

/// Mass of the robot [kg]: Unitree's URDF, with rotors. 157.8 N; a real Go2's standing torques say
/// 147.3 N, which is the same less the weight that the calves and feet carry themselves
/// (kLegMassKg).
inline constexpr double kRobotMassKg = 16.087;

/// Mass that each leg's torques move besides the body, as a point at the foot [kg]: that
/// difference, by four. Calf and foot weigh 0.194 kg in the URDF.
inline constexpr double kLegMassKg = 0.268;

}  // namespace geoflow::simulator
