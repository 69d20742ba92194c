#pragma once

#include <vector>

#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

/// How a trotting body moves about its way.
namespace geoflow::simulator {

/// The lines of the gait's spectrum with their amplitudes of step to step.
[[nodiscard]] std::vector<BodyOscillation> gait_oscillations(const WalkOptions& options);

/// The slow changes of posture.
[[nodiscard]] std::vector<BodyWander> body_wanders(const WalkOptions& options);

}  // namespace geoflow::simulator
