#pragma once

#include "geoflow/tools/console.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"

namespace geoflow::tools {

/// Prints an evaluation for people: one short table.
void print_report(Console& console, const Evaluation& evaluation, const EvaluationOptions& options);

}  // namespace geoflow::tools
