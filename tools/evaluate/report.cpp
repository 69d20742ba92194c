#include "evaluate/report.hpp"

#include <cstddef>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"

namespace geoflow::tools {
namespace {

constexpr double kPercent = 100.0;

void print_row(Console& console, std::string_view name, const Statistics& s) {
  console.line("{:<22} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f}", name, s.rmse,
               s.mean, s.median, s.std, s.min, s.max);
}

std::string relative_title(const Evaluation& evaluation, const RelativeOptions& options) {
  return fmt::format("relative error over {:g} {} ({} stretches, {})", options.delta,
                     to_string(options.unit), evaluation.stretches.size(),
                     options.all_pairs ? "from every pose" : "end to end");
}

}  // namespace

void print_report(Console& console, const Evaluation& evaluation,
                  const EvaluationOptions& options) {
  if (evaluation.timed) {
    console.line("pairs      {} over {:.3f} s", evaluation.pairs.size(),
                 to_seconds(evaluation.pairs.back().t - evaluation.pairs.front().t));
  } else {
    console.line("pairs      {}, line by line (files without times)", evaluation.pairs.size());
  }
  console.line("coverage   {:.2f} % of the reference's time", kPercent * evaluation.coverage);
  if (evaluation.correct_rate && options.coverage.max_error_m) {
    console.line("correct    {:.2f} % of the reference's time within {:g} m",
                 kPercent * *evaluation.correct_rate, *options.coverage.max_error_m);
  }
  console.line("path       {:.3f} m (reference), {:.3f} m (estimate)", evaluation.path.reference_m,
               evaluation.path.estimate_m);
  console.line("alignment  {}, scale {:.6f}", to_string(options.alignment),
               evaluation.alignment.scale);
  console.line("");
  console.line("{:<22} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}", "absolute error", "rmse", "mean",
               "median", "std", "min", "max");
  print_row(console, "  translation [m]", evaluation.ate.translation_m);
  print_row(console, "  rotation [deg]", evaluation.ate.rotation_deg);
  if (evaluation.path.reference_m > 0) {
    console.line("  {:.3f} % of the path",
                 kPercent * evaluation.ate.translation_m.rmse / evaluation.path.reference_m);
  }
  if (!evaluation.stretches.empty()) {
    console.line("{}", relative_title(evaluation, options.relative));
    print_row(console, "  translation [m]", evaluation.rpe.translation_m);
    print_row(console, "  rotation [deg]", evaluation.rpe.rotation_deg);
  }
}

void print_consistency(Console& console, const Consistency& consistency) {
  console.line("{:<22} {:>10} {:>10} {:>12} {:>10} {:>10}", "NEES (1: honest)", "estimates",
               "position", "orientation", "pose", "within 95%");
  for (std::size_t i = 0; i < consistency.by_status.size(); ++i) {
    const Nees& nees = consistency.by_status.at(i);
    if (nees.estimates > 0) {
      console.line("  {:<20} {:>10} {:>10.3f} {:>12.3f} {:>10.3f} {:>8.1f} %",
                   to_string(static_cast<TrackingStatus>(i)), nees.estimates, nees.position,
                   nees.orientation, nees.pose, kPercent * nees.within_95);
    }
  }
}

}  // namespace geoflow::tools
