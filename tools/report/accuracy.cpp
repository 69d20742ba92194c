#include "report/accuracy.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/plot.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "bench/suite/sequences.hpp"
#include "report/run_directory.hpp"

namespace geoflow::tools {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
constexpr int kOneRowPx = 560;
constexpr double kBand = 3;  ///< standard deviations
constexpr const char* kTimeLabel = "time since the first pair (s)";

/// The truth of the base, whosever it is.
Trajectory base_truth(const RunDirectory& run, const Reference& reference) {
  Trajectory truth = reference.trajectory.poses;
  if (reference.frame == ReferenceFrame::kCamera) {
    const SE3 T_cam_base = run.T_base_cam().inverse();
    for (StampedPose& stamped : truth) {
      stamped.pose = stamped.pose * T_cam_base;
    }
  }
  return truth;
}

Series relative_series(const Evaluation& evaluation, const std::string& label, const Color& color,
                       std::vector<double> PoseErrors::* which, double scale) {
  Series series{.label = label, .x = {}, .y = {}, .color = color};
  for (std::size_t i = 0; i < evaluation.stretches.size(); ++i) {
    const HostTime begin = evaluation.pairs[evaluation.stretches[i].first].t;
    series.x.push_back(to_seconds(begin - evaluation.pairs.front().t));
    series.y.push_back(scale * (evaluation.relative.*which)[i]);
  }
  return series;
}

Axes relative_axes(const Accuracy& accuracy, const std::string& what, const std::string& unit,
                   std::vector<double> PoseErrors::* which, double scale) {
  Axes axes{.title = fmt::format("{} error over {:g} {}", what, accuracy.options.relative.delta,
                                 to_string(accuracy.options.relative.unit)),
            .x_label = kTimeLabel,
            .y_label = fmt::format("error ({})", unit),
            .y_from_zero = true};
  axes.series.push_back(relative_series(accuracy.live, "live", kSeriesColors[1], which, scale));
  axes.series.push_back(relative_series(accuracy.last, "final", kSeriesColors[0], which, scale));
  return axes;
}

std::vector<double> times(const std::vector<NormalisedError>& errors) {
  std::vector<double> t;
  t.reserve(errors.size());
  for (const NormalisedError& one : errors) {
    t.push_back(to_seconds(one.t - errors.front().t));
  }
  return t;
}

/// One component of the error, an index into NormalisedError::error.
Axes component_axes(const std::vector<NormalisedError>& errors, int component) {
  constexpr std::array kNames{"Rotation about x", "Rotation about y", "Rotation about z",
                              "Position along x", "Position along y", "Position along z"};
  constexpr int kRotations = 3;
  const bool rotation = component < kRotations;
  const double scale = rotation ? kDegreesPerRadian : 1;
  Series error{.label = "error", .x = times(errors), .y = {}};
  Series low{.label = "", .x = error.x, .y = {}, .color = kReferenceColor, .dashed = true};
  Series high = low;
  high.label = "3 standard deviations";
  for (const NormalisedError& one : errors) {
    error.y.push_back(scale * one.error[component]);
    high.y.push_back(scale * kBand * one.sigma[component]);
    low.y.push_back(-high.y.back());
  }
  return {.title = kNames.at(static_cast<std::size_t>(component)),
          .x_label = kTimeLabel,
          .y_label = rotation ? "error (deg)" : "error (m)",
          .series = {std::move(low), std::move(high), std::move(error)}};
}

Axes nees_axes(const std::vector<NormalisedError>& errors) {
  Series pose{.label = "pose", .x = times(errors), .y = {}};
  for (const NormalisedError& one : errors) {
    pose.y.push_back(one.nees_pose);
  }
  const std::vector<double> ends{pose.x.front(), pose.x.back()};
  return {.title = "NEES for each degree of freedom",
          .x_label = kTimeLabel,
          .y_label = "NEES",
          .y_from_zero = true,
          .series = {{.label = "true on average",
                      .x = ends,
                      .y = {1, 1},
                      .color = kReferenceColor,
                      .dashed = true},
                     {.label = "95 % of true ones are below",
                      .x = ends,
                      .y = {kNeesPose95, kNeesPose95},
                      .color = kSeriesColors[1],
                      .dashed = true},
                     std::move(pose)}};
}

}  // namespace

Result<Reference> read_named_reference(const std::filesystem::path& file,
                                       std::optional<ReferenceFrame> frame) {
  const ReferenceFrame by_name =
      file.filename() == "groundtruth_base.txt" ? ReferenceFrame::kBase : ReferenceFrame::kCamera;
  return read_trajectory(file).map([&](TrajectoryFile trajectory) {
    return Reference{.trajectory = std::move(trajectory),
                     .frame = frame.value_or(by_name),
                     .name = file.string()};
  });
}

Result<std::optional<Reference>> find_reference(const std::filesystem::path& recording) {
  const std::optional<Sequence> sequence = sequence_at(recording);
  if (!sequence) {
    return std::nullopt;
  }
  const std::filesystem::path& name =
      sequence->reference.empty() ? sequence->recording : sequence->reference;
  return read_reference(*sequence).map([&](TrajectoryFile trajectory) {
    return std::optional{Reference{
        .trajectory = std::move(trajectory), .frame = sequence->frame, .name = name.string()}};
  });
}

Result<Accuracy> measure_accuracy(const RunDirectory& run, const Reference& reference) {
  const bool camera = reference.frame == ReferenceFrame::kCamera;
  Accuracy accuracy{.reference = reference.name};
  const TrajectoryFile& live_file = camera ? run.live_camera : run.live_base;
  auto live = evaluate(live_file, reference.trajectory, accuracy.options);
  if (!live) {
    return tl::unexpected{std::move(live.error())};
  }
  const TrajectoryFile& last_file = camera ? run.final_camera : run.final_base;
  auto last = evaluate(last_file, reference.trajectory, accuracy.options);
  if (!last) {
    return tl::unexpected{std::move(last.error())};
  }
  accuracy.live = *std::move(live);
  accuracy.last = *std::move(last);
  accuracy.normalised =
      normalised_errors(run.estimates, base_truth(run, reference), accuracy.options.association);
  return accuracy;
}

Figure relative_error_figure(const Accuracy& accuracy) {
  Figure figure{.title = "Relative error", .subtitle = accuracy.reference, .height_px = kOneRowPx};
  figure.axes.push_back(relative_axes(accuracy, "Position", "m", &PoseErrors::translation_m, 1));
  figure.axes.push_back(
      relative_axes(accuracy, "Rotation", "deg", &PoseErrors::rotation_rad, kDegreesPerRadian));
  return figure;
}

Figure consistency_figure(const std::vector<NormalisedError>& errors) {
  Figure figure{.title = "Error beside its claimed covariance",
                .subtitle = "of T_odom_base since the first pair, in the base's axes",
                .columns = 3};
  for (const int component : {3, 4, 5, 0, 1, 2}) {
    figure.axes.push_back(component_axes(errors, component));
  }
  figure.axes.push_back(nees_axes(errors));
  return figure;
}

}  // namespace geoflow::tools
