#pragma once

#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::simulator {

/// A time in which the gait runs.
struct GaitInterval {
  double start_s = 0;
  double end_s = 0;
};

/// All stances of one leg: when it stands by the gait's clock, where it is put down, when it slips
/// and how it rolls. Swings lie within the gait's intervals. Errors: a step that the leg does not
/// reach.
[[nodiscard]] Result<std::vector<Stance>> plan_stances(const BodyTrajectory& body,
                                                       const WalkOptions& options, Leg leg,
                                                       std::span<const GaitInterval> gait);

}  // namespace geoflow::simulator
