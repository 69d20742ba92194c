#pragma once

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {

struct GicpBenchmarkOptions;

/// Measures this project's GICP beside PCL's (gicp_benchmark.hpp): two rows, one for each engine, a
/// step; `times_faster` is PCL's total over ours. Errors as run_gicp_benchmark(); kUnsupported in a
/// build without GEOFLOW_BENCHMARKS.
[[nodiscard]] Result<BenchTable> run_gicp_table(const GicpBenchmarkOptions& options);

}  // namespace geoflow::tools
