#include "calibrate/imu_command.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/calibration/imu_intrinsics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

#include "calibrate/imu_recording.hpp"
#include "calibrate/outcome.hpp"

namespace geoflow::tools {
namespace {

using calibration::Finding;
using calibration::ImuIntrinsicsEstimate;
using calibration::ImuPose;

constexpr int kFigureHeightPx = 520;

Series by_pose(const std::string& label, const std::vector<double>& values, const Color& color) {
  Series series;
  series.label = label;
  series.color = color;
  for (std::size_t i = 0; i < values.size(); ++i) {
    series.x.push_back(static_cast<double>(i + 1));
    series.y.push_back(values[i]);
  }
  return series;
}

Figure figure(const ImuIntrinsicsEstimate& estimate, const std::filesystem::path& recording) {
  Figure figure{.title = "Readings at rest",
                .subtitle = fmt::format("{}, {} poses", recording.string(), estimate.poses.size()),
                .height_px = kFigureHeightPx};
  Axes lengths{.title = "Length of the accelerometer's reading less gravity",
               .x_label = "pose",
               .y_label = "m/s^2"};
  lengths.series.push_back(by_pose("as it says", estimate.before_mps2, kReferenceColor));
  lengths.series.push_back(by_pose("corrected", estimate.after_mps2, kSeriesColors[0]));
  Axes directions{.title = "Up, in the IMU's frame", .x_label = "pose", .y_label = "m/s^2"};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    values.reserve(estimate.poses.size());
    for (const ImuPose& pose : estimate.poses) {
      values.push_back(pose.mean.accel_mps2[axis]);
    }
    const auto index = static_cast<std::size_t>(axis);
    directions.series.push_back(
        by_pose(std::string{"xyz"}.substr(index, 1), values, kSeriesColors.at(index)));
  }
  figure.axes = {std::move(lengths), std::move(directions)};
  return figure;
}

/// Every parameter; names with underscores, as keys have no dots.
std::vector<std::pair<std::string, double>> results(const std::vector<Finding>& findings) {
  std::vector<std::pair<std::string, double>> values;
  for (const Finding& finding : findings) {
    std::string key = finding.name;
    for (char& c : key) {
      c = c == '.' ? '_' : c;
    }
    values.emplace_back(std::move(key), finding.value);
  }
  return values;
}

}  // namespace

Result<Outcome> calibrate_imu(const std::filesystem::path& recording,
                              const calibration::ImuIntrinsicsOptions& options) {
  const auto imu = read_imu(recording);
  if (!imu) {
    return tl::unexpected{imu.error()};
  }
  auto estimate = calibration::estimate_imu_intrinsics(imu->samples, options);
  if (!estimate) {
    return tl::unexpected{std::move(estimate.error()).in(recording.string())};
  }
  const std::vector<Finding> findings = calibration::judge(*estimate, options);
  std::vector<std::string> facts{
      fmt::format("It lies still {} times for {} s or more; gravity is taken to be {} m/s^2.",
                  estimate->poses.size(), options.min_still_s, options.gravity_mps2)};
  return Outcome{.what = "imu",
                 .title = "Scale, misalignment and bias of the IMU",
                 .input = {.recording = recording,
                           .serial = imu->serial,
                           .hash = imu->hash,
                           .facts = std::move(facts)},
                 .findings = findings,
                 .results = results(findings),
                 .figures = {figure(*estimate, recording)}};
}

}  // namespace geoflow::tools
