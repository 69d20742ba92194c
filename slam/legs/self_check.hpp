#pragma once

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::slam {

/// How a standing robot's joint torques carry it.
struct StandingLoad {
  Vector3d force_base = Vector3d::Zero();  ///< sum of the ground's forces on the feet, in base [N]
  double weight_n = 0;                     ///< its part along `up`
  double centre_x_m = 0;  ///< where the weight's line passes, forwards of base's origin
  double outward_n = 0;   ///< mean sideways force by which feet are pushed apart, per foot
};

/// Checks the wiring of legs while the robot stands still on level ground: what the torques carry
/// must be the robot's weight. Tells a wrong order of legs, a wrong sign or a wrong scale of the
/// torques before they mislead anything. Pure.
///
/// `sample` is one instant, better the mean of a second; `up_base` is against gravity;
/// `mass_kg` the robot's. Accepted: weight within 15 %, of which a Go2's two published masses
/// differ by 6 and its torque estimate's scale by a few more; level forces below 10 N in sum and
/// per foot sideways; weight over the middle half of the feet. A swap of front and rear is
/// not seen: both carry about half. Errors (kInvalidData) say which of these fails and what would
/// explain it; (kUnavailable): not all legs heard, or no torques. Source of the idea and of 147.3 N
/// on a real Go2: sum of -J^-T tau.
[[nodiscard]] Result<StandingLoad> check_standing_load(const LegGeometry& geometry,
                                                       const LegSample& sample,
                                                       const Vector3d& up_base, double mass_kg);

}  // namespace geoflow::slam
