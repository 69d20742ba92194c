#include <utility>

#include <nlohmann/json.hpp>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"

namespace geoflow::tools {
namespace {

constexpr double kPercent = 100.0;

nlohmann::json to_json(const Statistics& s) {
  return {{"count", s.count}, {"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},
          {"std", s.std},     {"min", s.min},   {"max", s.max},   {"sse", s.sse}};
}

nlohmann::json to_json(const ErrorStatistics& s) {
  return {{"translation_m", to_json(s.translation_m)}, {"rotation_deg", to_json(s.rotation_deg)}};
}

nlohmann::json to_json(const Similarity& alignment, Alignment kind) {
  const auto& q = alignment.T_ref_est.rotation();
  const auto& p = alignment.T_ref_est.translation();
  return {{"kind", to_string(kind)},
          {"scale", alignment.scale},
          {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}},
          {"translation_m", {p.x(), p.y(), p.z()}}};
}

nlohmann::json relative(const Evaluation& evaluation, const RelativeOptions& options) {
  if (evaluation.stretches.empty()) {
    return nullptr;
  }
  nlohmann::json object = to_json(evaluation.rpe);
  object["delta"] = options.delta;
  object["unit"] = to_string(options.unit);
  object["all_pairs"] = options.all_pairs;
  return object;
}

nlohmann::json duration(const Evaluation& evaluation) {
  if (!evaluation.timed) {
    return nullptr;
  }
  return to_seconds(evaluation.pairs.back().t - evaluation.pairs.front().t);
}

}  // namespace

nlohmann::json to_json(const Evaluation& evaluation, const EvaluationOptions& options) {
  nlohmann::json ate = to_json(evaluation.ate);
  ate["percent_of_path"] = evaluation.path.reference_m > 0
                               ? nlohmann::json(kPercent * evaluation.ate.translation_m.rmse /
                                                evaluation.path.reference_m)
                               : nlohmann::json(nullptr);
  nlohmann::json object{
      {"pairs", evaluation.pairs.size()},
      {"max_difference_s", to_seconds(options.association.max_difference)},
      {"offset_s", to_seconds(options.association.offset)},
      {"duration_s", duration(evaluation)},
      {"coverage", evaluation.coverage},
      {"path_m",
       {{"estimate", evaluation.path.estimate_m}, {"reference", evaluation.path.reference_m}}},
      {"alignment", to_json(evaluation.alignment, options.alignment)},
      {"ate", std::move(ate)},
      {"rpe", relative(evaluation, options.relative)},
      {"warnings", evaluation.warnings}};
  if (evaluation.correct_rate && options.coverage.max_error_m) {
    object["correct_rate"] = {{"within_m", *options.coverage.max_error_m},
                              {"rate", *evaluation.correct_rate}};
  }
  return object;
}

}  // namespace geoflow::tools
