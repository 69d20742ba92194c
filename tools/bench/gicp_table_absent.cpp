#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

#include "bench/gicp_benchmark.hpp"
#include "bench/gicp_table.hpp"

namespace geoflow::tools {

Result<BenchTable> run_gicp_table(const GicpBenchmarkOptions& /*options*/) {
  return fail(ErrorCode::kUnsupported,
              "this build has no benchmark beside PCL: configure with -DGEOFLOW_BENCHMARKS=ON");
}

}  // namespace geoflow::tools
