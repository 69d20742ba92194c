#pragma once

#include "geoflow/tools/console.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"

namespace geoflow::tools {

/// Prints an evaluation for people: one short table.
void print_report(Console& console, const Evaluation& evaluation, const EvaluationOptions& options);

/// Prints how honest covariances are: one row for each status that occurred.
void print_consistency(Console& console, const Consistency& consistency);

}  // namespace geoflow::tools
