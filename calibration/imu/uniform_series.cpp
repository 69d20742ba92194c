#include "imu/uniform_series.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::calibration {
namespace {

using Values = std::array<double, kImuAxes>;

Values values_of(const ImuSample& sample) {
  Values values{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto row = static_cast<Eigen::Index>(axis);
    values.at(axis) = sample.accel_mps2[row];
    values.at(axis + 3) = sample.gyro_radps[row];
  }
  return values;
}

void append(UniformSeries& series, const Values& values, bool filled) {
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    series.axes.at(axis).push_back(values.at(axis));
  }
  series.filled.push_back(filled);
}

/// The `missing` samples between two, on a straight line.
void fill(UniformSeries& series, const Values& from, const Values& to, std::size_t missing) {
  for (std::size_t i = 1; i <= missing; ++i) {
    const double ratio = static_cast<double>(i) / static_cast<double>(missing + 1);
    Values between{};
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
      between.at(axis) = from.at(axis) + ratio * (to.at(axis) - from.at(axis));
    }
    append(series, between, true);
  }
}

Result<void> check(std::span<const Timed<ImuSample>> samples) {
  if (samples.size() < 2) {
    return fail(ErrorCode::kInvalidData, "it has {} inertial samples", samples.size());
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!samples[i].sample.accel_mps2.allFinite() || !samples[i].sample.gyro_radps.allFinite()) {
      return fail(ErrorCode::kInvalidData, "inertial sample {} has a value that is no number",
                  i + 1);
    }
    if (i > 0 && samples[i].t <= samples[i - 1].t) {
      return fail(ErrorCode::kInvalidData, "inertial sample {} is not later than the one before",
                  i + 1);
    }
  }
  return {};
}

double median_interval_s(std::span<const Timed<ImuSample>> samples) {
  std::vector<Duration> intervals;
  intervals.reserve(samples.size());
  for (std::size_t i = 1; i < samples.size(); ++i) {
    intervals.push_back(samples[i].t - samples[i - 1].t);
  }
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::ranges::nth_element(intervals, middle);
  return to_seconds(*middle);
}

}  // namespace

Result<UniformRecording> make_uniform(std::span<const Timed<ImuSample>> samples) {
  if (auto checked = check(samples); !checked) {
    return tl::unexpected{checked.error()};
  }
  UniformRecording recording{.period_s = median_interval_s(samples), .pieces = {}};
  Values before{};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Values values = values_of(samples[i].sample);
    const double interval_s = i == 0 ? 0.0 : to_seconds(samples[i].t - samples[i - 1].t);
    const double periods = std::round(interval_s / recording.period_s);
    if (i == 0 || periods > static_cast<double>(kLongestGap + 1)) {
      recording.pieces.push_back({.begin = samples[i].t});
    } else if (periods > 1) {
      fill(recording.pieces.back(), before, values, static_cast<std::size_t>(periods) - 1);
    }
    append(recording.pieces.back(), values, false);
    before = values;
  }
  return recording;
}

}  // namespace geoflow::calibration
