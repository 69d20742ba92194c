#pragma once

#include <string>

#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {

/// The figure of an evaluation: the path from two sides, coloured by its error, and the errors over
/// time. The first view shows the two axes along which the reference extends the most, so it is the
/// top view of a robot on the ground.
[[nodiscard]] Figure evaluation_figure(const Evaluation& evaluation,
                                       const EvaluationOptions& options, const std::string& title);

}  // namespace geoflow::tools
