#include "calibrate/imu_noise_command.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/calibration/allan.hpp"
#include "geoflow/calibration/imu_noise.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/plot.hpp"

#include "calibrate/imu_recording.hpp"
#include "calibrate/outcome.hpp"

namespace geoflow::tools {
namespace {

using calibration::AllanPoint;
using calibration::AxisNoise;
using calibration::ImuNoiseEstimate;
using calibration::NoiseTerms;

constexpr std::array<const char*, 3> kAxisLetters{"x", "y", "z"};
constexpr int kFigureHeightPx = 620;
/// Averaging times begin at one period; more than this, and the shortest ones were left out.
constexpr double kFirstScale = 1.5;

/// The Allan deviation that the three noises make at `tau_s`.
double model(const NoiseTerms& terms, double tau_s) {
  return std::sqrt(terms.white.power / tau_s +
                   terms.bias_instability.power * 2 * std::numbers::ln2 / std::numbers::pi +
                   terms.random_walk.power * tau_s / 3);
}

Axes curves(const ImuNoiseEstimate& estimate, std::size_t first, const NoiseTerms& mean,
            const std::string& title, const std::string& unit) {
  Axes axes{.title = title,
            .x_label = "averaging time (s)",
            .y_label = "Allan deviation (" + unit + ")",
            .log_x = true,
            .log_y = true};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Series series;
    series.label = kAxisLetters.at(axis);
    series.color = kSeriesColors.at(axis);
    for (const AllanPoint& point : estimate.axes.at(first + axis).curve) {
      series.x.push_back(point.tau_s);
      series.y.push_back(point.deviation);
    }
    axes.series.push_back(std::move(series));
  }
  Series fitted;
  fitted.label = "model, mean of the axes";
  fitted.color = kReferenceColor;
  fitted.dashed = true;
  fitted.x = axes.series.front().x;
  for (const double tau_s : fitted.x) {
    fitted.y.push_back(model(mean, tau_s));
  }
  axes.series.push_back(std::move(fitted));
  return axes;
}

Figure figure(const ImuNoiseEstimate& estimate, const std::filesystem::path& recording) {
  Figure figure{.title = "Overlapping Allan deviation",
                .subtitle = fmt::format("{}, {:.1f} s at {:.1f} Hz", recording.string(),
                                        to_seconds(estimate.length), estimate.rate_hz),
                .height_px = kFigureHeightPx};
  figure.axes.push_back(curves(estimate, 0, estimate.accel, "Accelerometer", "m/s^2"));
  figure.axes.push_back(curves(estimate, 3, estimate.gyro, "Gyroscope", "rad/s"));
  return figure;
}

/// What the estimator reads, by Kalibr's names; what is not determined is left to its defaults.
std::vector<std::pair<std::string, double>> results(const ImuNoiseEstimate& estimate) {
  std::vector<std::pair<std::string, double>> values{{"rate_hz", estimate.rate_hz}};
  const auto add = [&](const char* name, const calibration::NoiseTerm& term) {
    if (term.determined()) {
      values.emplace_back(name, term.value());
    }
  };
  add("accel_noise_density", estimate.accel.white);
  add("accel_random_walk", estimate.accel.random_walk);
  add("gyro_noise_density", estimate.gyro.white);
  add("gyro_random_walk", estimate.gyro.random_walk);
  return values;
}

std::vector<std::string> facts(const ImuNoiseEstimate& estimate, const ImuRecording& imu) {
  std::vector<std::string> sentences{
      fmt::format("It stands still for {:.1f} s, from {:.1f} s on: {} samples at {:.2f} Hz, {} of "
                  "them filled in.",
                  to_seconds(estimate.length), to_seconds(estimate.begin - imu.samples.front().t),
                  estimate.samples, estimate.rate_hz, estimate.filled)};
  for (std::size_t axis = 0; axis < estimate.axes.size(); ++axis) {
    const AxisNoise& noise = estimate.axes.at(axis);
    if (noise.shortest_tau_s * estimate.rate_hz > kFirstScale) {
      sentences.push_back(
          fmt::format("{}: averaging times below {:.3g} s were left out: its "
                      "samples are filtered.",
                      calibration::imu_axis_name(axis), noise.shortest_tau_s));
    }
  }
  if (imu.rejected > 0) {
    sentences.push_back(fmt::format("{} samples could not be read.", imu.rejected));
  }
  return sentences;
}

}  // namespace

Result<Outcome> calibrate_imu_noise(const std::filesystem::path& recording,
                                    const calibration::ImuNoiseOptions& options) {
  const auto imu = read_imu(recording);
  if (!imu) {
    return tl::unexpected{imu.error()};
  }
  auto estimate = calibration::estimate_imu_noise(imu->samples, options);
  if (!estimate) {
    return tl::unexpected{std::move(estimate.error()).in(recording.string())};
  }
  return Outcome{.what = "imu-noise",
                 .title = "Noise of the IMU",
                 .input = {.recording = recording,
                           .serial = imu->serial,
                           .hash = imu->hash,
                           .facts = facts(*estimate, *imu)},
                 .findings = calibration::judge(*estimate),
                 .results = results(*estimate),
                 .figures = {figure(*estimate, recording)}};
}

}  // namespace geoflow::tools
