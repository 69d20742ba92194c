#include "geoflow/tools/evaluate/evaluation.hpp"

#include <numbers>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

ErrorStatistics error_statistics(const PoseErrors& errors) {
  std::vector<double> rotation_deg = errors.rotation_rad;
  for (double& angle : rotation_deg) {
    angle *= kDegreesPerRadian;
  }
  return {.translation_m = statistics(errors.translation_m),
          .rotation_deg = statistics(std::move(rotation_deg))};
}

}  // namespace

Result<Evaluation> evaluate(const TrajectoryFile& estimate, const TrajectoryFile& reference,
                            const EvaluationOptions& options) {
  auto pairs = associate(estimate, reference, options.association);
  if (!pairs) {
    return tl::unexpected{std::move(pairs).error()};
  }
  const auto alignment = align(*pairs, options.alignment);
  if (!alignment) {
    return tl::unexpected{alignment.error()};
  }
  Evaluation result;
  result.alignment = *alignment;
  result.pairs = transformed(*alignment, *std::move(pairs));
  auto found = stretches(result.pairs, options.relative);
  if (!found) {
    return tl::unexpected{std::move(found).error()};
  }
  result.stretches = *std::move(found);
  result.absolute = absolute_errors(result.pairs);
  result.relative = relative_errors(result.pairs, result.stretches);
  result.ate = error_statistics(result.absolute);
  result.rpe = error_statistics(result.relative);
  result.path = path_lengths(result.pairs);
  const auto rate = [&](const CoverageOptions& coverage) {
    return correct_rate(result.pairs, reference.poses.front().t, reference.poses.back().t,
                        coverage);
  };
  result.coverage = rate({.max_gap = options.coverage.max_gap});
  if (options.coverage.max_error_m) {
    result.correct_rate = rate(options.coverage);
  }
  result.timed = estimate.format != TrajectoryFormat::kKitti;
  result.warnings = estimate.warnings;
  result.warnings.insert(result.warnings.end(), reference.warnings.begin(),
                         reference.warnings.end());
  if (result.stretches.empty()) {
    result.warnings.push_back(fmt::format("no stretch of {:g} {}: no relative error",
                                          options.relative.delta,
                                          to_string(options.relative.unit)));
  }
  return result;
}

}  // namespace geoflow::tools
