#include "evaluate/figure.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"
#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
constexpr double kPathWidthPx = 2.4;
constexpr double kReferenceWidthPx = 1.2;
constexpr std::array<const char*, 3> kAxisNames{"x", "y", "z"};

/// The axes of the reference's frame, 0 to 2, widest extent first.
std::array<int, 3> axes_by_extent(const PosePairs& pairs) {
  Vector3d low = pairs.front().reference.translation();
  Vector3d high = low;
  for (const PosePair& pair : pairs) {
    low = low.cwiseMin(pair.reference.translation());
    high = high.cwiseMax(pair.reference.translation());
  }
  const Vector3d extent = high - low;
  std::array<int, 3> order{0, 1, 2};
  std::ranges::sort(order,
                    [&](int a, int b) { return std::tie(extent[b], a) < std::tie(extent[a], b); });
  return order;
}

std::vector<double> coordinates(const PosePairs& pairs, SE3 PosePair::* which, int axis) {
  std::vector<double> values;
  values.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    values.push_back((pair.*which).translation()[axis]);
  }
  return values;
}

/// Reference in gray below the estimate coloured by its position error.
Axes path_view(const Evaluation& evaluation, int right, int up) {
  const std::string x = kAxisNames.at(static_cast<std::size_t>(right));
  const std::string y = kAxisNames.at(static_cast<std::size_t>(up));
  Axes axes{.title = fmt::format("Path, {}-{} plane", x, y),
            .x_label = x + " (m)",
            .y_label = y + " (m)",
            .value_label = "position error (m)",
            .equal_aspect = true};
  axes.series.push_back({.label = "reference",
                         .x = coordinates(evaluation.pairs, &PosePair::reference, right),
                         .y = coordinates(evaluation.pairs, &PosePair::reference, up),
                         .color = kReferenceColor,
                         .width_px = kReferenceWidthPx,
                         .dashed = true});
  axes.series.push_back({.label = "estimate",
                         .x = coordinates(evaluation.pairs, &PosePair::estimate, right),
                         .y = coordinates(evaluation.pairs, &PosePair::estimate, up),
                         .width_px = kPathWidthPx,
                         .values = evaluation.absolute.translation_m});
  return axes;
}

Series level(const std::string& label, double value, const std::string& unit,
             const std::vector<double>& t, const Color& color) {
  return {.label = fmt::format("{} {:.4g} {}", label, value, unit),
          .x = {t.front(), t.back()},
          .y = {value, value},
          .color = color,
          .dashed = true};
}

Axes error_view(const std::string& what, const std::string& unit, const std::vector<double>& t,
                std::vector<double> errors, const Statistics& summary) {
  Axes axes{.title = what + " error",
            .x_label = "",
            .y_label = fmt::format("error ({})", unit),
            .y_from_zero = true};
  axes.series.push_back(
      {.label = "error", .x = t, .y = std::move(errors), .color = kSeriesColors[0]});
  axes.series.push_back(level("RMSE", summary.rmse, unit, t, kSeriesColors[1]));
  axes.series.push_back(level("median", summary.median, unit, t, kSeriesColors[2]));
  return axes;
}

}  // namespace

Figure evaluation_figure(const Evaluation& evaluation, const EvaluationOptions& options,
                         const std::string& title) {
  const auto order = axes_by_extent(evaluation.pairs);
  // The lower of the two widest axes points to the right, so that x-y is not shown as y-x.
  const int right = std::min(order[0], order[1]);
  const int up = std::max(order[0], order[1]);
  std::vector<double> t;
  t.reserve(evaluation.pairs.size());
  for (const PosePair& pair : evaluation.pairs) {
    t.push_back(to_seconds(pair.t - evaluation.pairs.front().t));
  }
  std::vector<double> rotation_deg = evaluation.absolute.rotation_rad;
  for (double& angle : rotation_deg) {
    angle *= kDegreesPerRadian;
  }
  Figure figure{
      .title = title,
      .subtitle = fmt::format("{} pairs, alignment {}, ATE RMSE {:.4g} m, path {:.4g} m",
                              evaluation.pairs.size(), to_string(options.alignment),
                              evaluation.ate.translation_m.rmse, evaluation.path.reference_m)};
  figure.axes.push_back(path_view(evaluation, right, up));
  figure.axes.push_back(path_view(evaluation, right, order[2]));
  figure.axes.push_back(error_view("Position", "m", t, evaluation.absolute.translation_m,
                                   evaluation.ate.translation_m));
  figure.axes.push_back(
      error_view("Rotation", "deg", t, std::move(rotation_deg), evaluation.ate.rotation_deg));
  for (std::size_t i = 2; i < figure.axes.size(); ++i) {
    figure.axes[i].x_label = evaluation.timed ? "time since the first pose (s)" : "pose";
  }
  return figure;
}

}  // namespace geoflow::tools
