#include "bench/gicp_table.hpp"

#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

#include "bench/gicp_benchmark.hpp"

namespace geoflow::tools {
namespace {

constexpr double kMillimetresPerMetre = 1e3;
constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

/// How much longer PCL takes for the same step in the same run; not a number for other rows.
double speed_up(const GicpBenchmarkRow& row, const std::vector<GicpBenchmarkRow>& rows) {
  for (const GicpBenchmarkRow& other : rows) {
    if (row.engine == "geoflow" && other.engine == "pcl" && other.step == row.step &&
        row.total_ms > 0) {
      return other.total_ms / row.total_ms;
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

Result<BenchTable> run_gicp_table(const GicpBenchmarkOptions& options) {
  const auto rows = run_gicp_benchmark(options);
  if (!rows) {
    return tl::unexpected{rows.error()};
  }
  BenchTable table{
      .benchmark = "gicp",
      .columns = {"engine", "step", "pairs", "points", "preprocess_ms", "register_ms", "total_ms",
                  "total_p95_ms", "times_faster", "error_median_mm", "error_rms_mm",
                  "error_median_deg", "error_rms_deg", "not_converged", "nees_mean"},
      .rows = {}};
  for (const GicpBenchmarkRow& row : *rows) {
    table.rows.push_back(
        {row.engine, std::int64_t{row.step}, std::int64_t{row.pairs}, row.points, row.preprocess_ms,
         row.register_ms, row.total_ms, row.total_p95_ms, speed_up(row, *rows),
         row.translation_median_m * kMillimetresPerMetre,
         row.translation_rms_m * kMillimetresPerMetre, row.rotation_median_rad * kDegreesPerRadian,
         row.rotation_rms_rad * kDegreesPerRadian, std::int64_t{row.not_converged},
         row.engine == "pcl" ? std::numeric_limits<double>::quiet_NaN() : row.nees_mean});
  }
  return table;
}

}  // namespace geoflow::tools
