#include "geoflow/calibration/imu_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/calibration/allan.hpp"
#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "imu/noise_fit.hpp"
#include "imu/still_stretch.hpp"
#include "imu/uniform_series.hpp"

namespace geoflow::calibration {
namespace {

constexpr std::array<const char*, kImuAxes> kAxisNames{"accel_x", "accel_y", "accel_z",
                                                       "gyro_x",  "gyro_y",  "gyro_z"};
/// A power this many standard deviations above none is there.
constexpr double kSignificant = 3;
constexpr double kBoundSigmas = 2;
/// More missing samples than this part spoil the short averaging times.
constexpr double kMostFilled = 0.01;
constexpr int kCurvePointsPerOctave = 4;
/// Distinct values up to which they are counted.
constexpr std::size_t kCounted = 16;
/// An axis that says no more values than these shows its steps, not its noise.
constexpr std::size_t kFewestValues = 4;

constexpr double kPercent = 100;
constexpr double kGoodWhite = 0.025;  ///< relative standard deviation
constexpr double kGoodWalk = 0.3;
/// A misfit above this is more than chance: the model is not the whole truth.
constexpr double kPoorMisfit = 3;
/// Axes of one sensor are alike within this factor.
constexpr double kAlike = 3;

NoiseTerm term(const NoiseFit& fit, Eigen::Index which) {
  return {.power = fit.powers[which], .power_sigma = std::sqrt(fit.covariance(which, which))};
}

std::size_t count_distinct(std::span<const double> values) {
  std::set<double> distinct;
  for (const double value : values) {
    distinct.insert(value);
    if (distinct.size() == kCounted) {
      break;
    }
  }
  return distinct.size();
}

AxisNoise measure_axis(std::span<const double> values, double period_s) {
  const NoiseFit fit = fit_noise(values, period_s);
  return {.terms = {.white = term(fit, 0),
                    .bias_instability = term(fit, 1),
                    .random_walk = term(fit, 2)},
          .curve = overlapping_allan(values, period_s,
                                     allan_factors(values.size() / 2, kCurvePointsPerOctave)),
          .shortest_tau_s = static_cast<double>(fit.shortest) * period_s,
          .misfit = fit.misfit,
          .distinct_values = count_distinct(values)};
}

/// Mean power over three axes.
NoiseTerm mean_term(std::span<const AxisNoise> axes, NoiseTerm NoiseTerms::* which) {
  NoiseTerm mean;
  double variance = 0;
  for (const AxisNoise& axis : axes) {
    const NoiseTerm& one = axis.terms.*which;
    mean.power += one.power / static_cast<double>(axes.size());
    variance += std::pow(one.power_sigma / static_cast<double>(axes.size()), 2);
  }
  mean.power_sigma = std::sqrt(variance);
  return mean;
}

NoiseTerms mean_terms(std::span<const AxisNoise> axes) {
  return {.white = mean_term(axes, &NoiseTerms::white),
          .bias_instability = mean_term(axes, &NoiseTerms::bias_instability),
          .random_walk = mean_term(axes, &NoiseTerms::random_walk)};
}

/// What of a recording is used, or why nothing is.
Result<StillStretch> choose_stretch(const UniformRecording& recording, HostTime start,
                                    const ImuNoiseOptions& options) {
  const StillStretch stretch = longest_still(recording);
  const double still_s = static_cast<double>(stretch.size()) * recording.period_s;
  if (still_s >= options.min_still_s && stretch.size() >= kFewestForNoise) {
    return stretch;
  }
  std::size_t total = 0;
  for (const UniformSeries& piece : recording.pieces) {
    total += piece.size();
  }
  const double total_s = static_cast<double>(total) * recording.period_s;
  const double needed_s =
      std::max(options.min_still_s, static_cast<double>(kFewestForNoise) * recording.period_s);
  if (total_s < needed_s) {
    return fail(ErrorCode::kInvalidData,
                "too short: it has {:.1f} s of inertial samples, {:.1f} s of standing still are "
                "needed (hours for the random walk)",
                total_s, needed_s);
  }
  const Duration offset =
      stretch.size() == 0
          ? Duration{}
          : recording.pieces[stretch.piece].begin - start +
                from_seconds(static_cast<double>(stretch.begin) * recording.period_s);
  return fail(ErrorCode::kInvalidData,
              "it moves: the longest stretch of standing still is {:.1f} s, from {:.1f} s on; "
              "{:.1f} s are needed, lying on something that does not shake",
              still_s, to_seconds(offset), needed_s);
}

Result<void> check_axes(const ImuNoiseEstimate& estimate) {
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const AxisNoise& noise = estimate.axes.at(axis);
    if (noise.distinct_values < kFewestValues) {
      return fail(ErrorCode::kInvalidData,
                  "{} says only {} different values while it stands still: its steps are coarser "
                  "than its noise, or it is stuck",
                  kAxisNames.at(axis), noise.distinct_values);
    }
    if (!noise.terms.white.determined()) {
      return fail(ErrorCode::kInvalidData,
                  "{}: white noise does not show among slower changes ({:.3g} at most): a longer "
                  "recording, or one without vibration, is needed",
                  kAxisNames.at(axis), noise.terms.white.upper_bound());
    }
  }
  return {};
}

/// Units of the three densities.
struct Units {
  const char* white;
  const char* bias_instability;
  const char* random_walk;
};
constexpr Units kAccelUnits{
    .white = "m/s^2/sqrt(Hz)", .bias_instability = "m/s^2", .random_walk = "m/s^3/sqrt(Hz)"};
constexpr Units kGyroUnits{
    .white = "rad/s/sqrt(Hz)", .bias_instability = "rad/s", .random_walk = "rad/s^2/sqrt(Hz)"};

Finding found(std::string name, const NoiseTerm& noise, const char* unit) {
  if (!noise.determined()) {
    return {.name = std::move(name), .value = noise.upper_bound(), .unit = unit};
  }
  return {.name = std::move(name), .value = noise.value(), .sigma = noise.sigma(), .unit = unit};
}

Finding judge_white(const std::string& name, const NoiseTerm& noise, const char* unit) {
  Finding finding = found(name, noise, unit);
  if (noise.sigma() > kGoodWhite * noise.value()) {
    finding.verdict = Verdict::kWarn;
    finding.note = fmt::format("known to {:.1f} %: a longer recording would tell it to {:.1f} %",
                               kPercent * noise.sigma() / noise.value(), kPercent * kGoodWhite);
  }
  return finding;
}

Finding judge_walk(const std::string& name, const NoiseTerm& noise, const char* unit) {
  Finding finding = found(name, noise, unit);
  if (!noise.determined()) {
    finding.verdict = Verdict::kWarn;
    finding.note = "does not show in a recording as short as this one; it is below the value";
  } else if (noise.sigma() > kGoodWalk * noise.value()) {
    finding.verdict = Verdict::kWarn;
    finding.note = fmt::format("known to {:.0f} %: a longer recording is needed for {:.0f} %",
                               kPercent * noise.sigma() / noise.value(), kPercent * kGoodWalk);
  }
  return finding;
}

Finding judge_instability(const std::string& name, const NoiseTerm& noise, const char* unit) {
  Finding finding = found(name, noise, unit);
  if (!noise.determined()) {
    finding.note = "does not show beside the other two; it is below the value";
  }
  return finding;
}

std::vector<Finding> judge_terms(std::string_view name, const NoiseTerms& terms,
                                 const Units& units) {
  return {judge_white(fmt::format("{}.white_noise", name), terms.white, units.white),
          judge_instability(fmt::format("{}.bias_instability", name), terms.bias_instability,
                            units.bias_instability),
          judge_walk(fmt::format("{}.random_walk", name), terms.random_walk, units.random_walk)};
}

/// What one axis' curve, and its likeness to the others, say against its white noise.
void doubt(const AxisNoise& axis, const NoiseTerms& sensor, Finding& white) {
  const double ratio = axis.terms.white.value() / sensor.white.value();
  if (axis.misfit > kPoorMisfit) {
    white.verdict = Verdict::kWarn;
    white.note = fmt::format(
        "its Allan deviations are off the model's by {:.1f} standard deviations: it was shaken or "
        "moved, or its samples are filtered",
        std::sqrt(axis.misfit));
  } else if (ratio > kAlike || ratio * kAlike < 1) {
    white.verdict = Verdict::kWarn;
    white.note = fmt::format("{:.2g} times that of its sensor's other axes", ratio);
  }
}

}  // namespace

double NoiseTerm::value() const noexcept {
  return std::sqrt(power);
}
double NoiseTerm::sigma() const noexcept {
  return power_sigma / (2 * value());
}
bool NoiseTerm::determined() const noexcept {
  return power > kSignificant * power_sigma;
}
double NoiseTerm::upper_bound() const noexcept {
  return std::sqrt(power + kBoundSigmas * power_sigma);
}

const char* imu_axis_name(std::size_t axis) noexcept {
  return kAxisNames.at(axis);
}

Result<ImuNoiseEstimate> estimate_imu_noise(std::span<const Timed<ImuSample>> samples,
                                            const ImuNoiseOptions& options) {
  const auto recording = make_uniform(samples);
  if (!recording) {
    return tl::unexpected{recording.error()};
  }
  const auto stretch = choose_stretch(*recording, samples.front().t, options);
  if (!stretch) {
    return tl::unexpected{stretch.error()};
  }
  const UniformSeries& piece = recording->pieces[stretch->piece];
  const auto begin = static_cast<std::ptrdiff_t>(stretch->begin);
  const auto end = static_cast<std::ptrdiff_t>(stretch->end);
  const double period_s = recording->period_s;
  ImuNoiseEstimate estimate{
      .rate_hz = 1 / period_s,
      .begin = piece.begin + from_seconds(static_cast<double>(begin) * period_s),
      .length = from_seconds(static_cast<double>(stretch->size()) * period_s),
      .samples = stretch->size(),
      .filled = static_cast<std::size_t>(
          std::count(piece.filled.begin() + begin, piece.filled.begin() + end, true))};
  if (static_cast<double>(estimate.filled) > kMostFilled * static_cast<double>(estimate.samples)) {
    return fail(ErrorCode::kInvalidData,
                "{} of {} samples are missing while it stands still: record without losses",
                estimate.filled, estimate.samples);
  }
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const std::span<const double> values{piece.axes.at(axis)};
    estimate.axes.at(axis) =
        measure_axis(values.subspan(stretch->begin, stretch->size()), period_s);
  }
  const std::span<const AxisNoise> axes{estimate.axes};
  estimate.accel = mean_terms(axes.first(3));
  estimate.gyro = mean_terms(axes.last(3));
  return check_axes(estimate).map([&] { return estimate; });
}

std::vector<Finding> judge(const ImuNoiseEstimate& estimate) {
  std::vector<Finding> findings = judge_terms("accel", estimate.accel, kAccelUnits);
  std::ranges::move(judge_terms("gyro", estimate.gyro, kGyroUnits), std::back_inserter(findings));
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const bool accel = axis < 3;
    const AxisNoise& noise = estimate.axes.at(axis);
    auto own = judge_terms(kAxisNames.at(axis), noise.terms, accel ? kAccelUnits : kGyroUnits);
    doubt(noise, accel ? estimate.accel : estimate.gyro, own.front());
    std::ranges::move(own, std::back_inserter(findings));
  }
  return findings;
}

}  // namespace geoflow::calibration
