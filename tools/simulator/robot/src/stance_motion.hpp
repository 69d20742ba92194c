#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"

/// How a foot moves on the ground.
namespace geoflow::simulator {

/// Inverse kinematics for the centre of the foot's sphere: the joint angles of the leg that has it
/// at `centre_in_base`, or none out of reach.
[[nodiscard]] std::optional<Vector3d> joint_angles_of_centre(const LegGeometry& geometry, Leg leg,
                                                             const Vector3d& centre_in_base);

/// A leg whose contact point moves with a given velocity.
struct RollingMotion {
  LegMotion joints;
  Vector3d centre_rate_world = Vector3d::Zero();  ///< of the sphere's centre [m/s]
};

/// The joint rates, and with them the velocity of the sphere's centre, at which the material point
/// that touches the ground moves with `contact_mps` (in world) while the body moves as `body` says.
/// None where the leg does not reach.
[[nodiscard]] std::optional<RollingMotion> rolling_motion(const BodyState& body, Leg leg,
                                                          const Vector3d& centre_world,
                                                          const Vector3d& contact_mps,
                                                          double rolling_radius_m);

/// Horizontal velocity of the contact point by slipping; zero outside slips.
[[nodiscard]] Vector2d slip_rate(const Stance& stance, double t_s);

/// Height of the sphere's centre over the floor and its rate: the foot's radius, less what soft
/// ground has given in.
struct CentreHeight {
  double height_m = 0;
  double rate_mps = 0;
};
[[nodiscard]] CentreHeight centre_height(const Stance& stance, double ground_sink_m, double t_s);

/// Integrates the foot's rolling and slipping from `centre_world` at the stance's touchdown to its
/// liftoff (or the walk's end), and stores the way in `stance`. False where the leg does not reach.
[[nodiscard]] bool roll_through(const BodyTrajectory& body, const WalkOptions& options, Leg leg,
                                const Vector2d& centre_world, Stance& stance);

}  // namespace geoflow::simulator
