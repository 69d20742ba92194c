#pragma once

#include <nlohmann/json_fwd.hpp>

#include "geoflow/tools/plot.hpp"

#include "report/run_directory.hpp"

/// How a run went, without any truth.
namespace geoflow::tools {

/// Quality over time in one colour for each status, interrupted where frames have no pose; and the
/// standard deviations that were claimed of position and orientation.
[[nodiscard]] Figure course_figure(const RunDirectory& run);

/// What share of frames took how long, a plot for each stage, from the report's
/// `time_histograms_ms`; no axes where a run has none or they are not as `geoflow replay` writes
/// them.
[[nodiscard]] Figure time_figure(const nlohmann::json& report);

}  // namespace geoflow::tools
