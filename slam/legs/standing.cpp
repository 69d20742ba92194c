#include "legs/standing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <deque>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {
namespace {

constexpr Duration kWindow = std::chrono::milliseconds{300};
/// Fewer samples in a window prove nothing.
constexpr std::size_t kLeastSamples = 10;
/// A joint at rest turns by no more than this within a window [rad].
constexpr double kJointRange = 0.006;
/// Beyond the sensor's own noise: what motors and fans shake a standing robot by.
constexpr double kGyroShake = 0.015;  // [rad/s]
constexpr double kAccelShake = 0.15;  // [m/s^2]
/// A turn that the bias does not explain [rad/s].
constexpr double kTurn = 0.02;
/// Of the sensor's standard deviation.
constexpr double kNoiseMargin = 1.5;

template <typename Sample>
void push(std::deque<Timed<Sample>>& samples, HostTime t, const Sample& sample) {
  samples.push_back({.t = t, .sample = sample});
  // One sample older than the window is kept: it proves that the window is full.
  while (samples.size() > 2 && samples[1].t <= t - kWindow) {
    samples.pop_front();
  }
}

template <typename Sample>
bool fills_window(const std::deque<Timed<Sample>>& samples) {
  return samples.size() >= kLeastSamples && samples.back().t - samples.front().t >= kWindow;
}

}  // namespace

void StillnessDetector::add(HostTime t, const ImuSample& sample) {
  push(imu_, t, sample);
}

void StillnessDetector::add(HostTime t, const LegSample& sample) {
  push(legs_, t, sample);
}

bool StillnessDetector::joints_rest() const {
  if (legs_.empty()) {
    return true;
  }
  if (!fills_window(legs_)) {
    return false;
  }
  for (std::size_t joint = 0; joint < kLegCount * kJointsPerLeg; ++joint) {
    const auto angle = [&](const Timed<LegSample>& legs) {
      return legs.sample.joints.at(joint).q_rad;
    };
    const auto [lowest, highest] = std::ranges::minmax(legs_, {}, angle);
    if (!(angle(highest) - angle(lowest) < kJointRange)) {
      return false;
    }
  }
  return true;
}

std::optional<StillInterval> StillnessDetector::still(const Vector3d& bias_gyro) const {
  if (!fills_window(imu_) || !joints_rest()) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(imu_.size());
  Vector6d mean = Vector6d::Zero();
  Vector6d square = Vector6d::Zero();
  for (const Timed<ImuSample>& imu : imu_) {
    const Vector6d value = (Vector6d{} << imu.sample.gyro_radps, imu.sample.accel_mps2).finished();
    mean += value / count;
    square += value.cwiseAbs2() / count;
  }
  const Vector6d sigma = (square - mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
  const double root_rate = std::sqrt(noise_.rate_hz);
  const double gyro_bound = kNoiseMargin * noise_.gyro_noise_density * root_rate + kGyroShake;
  const double accel_bound = kNoiseMargin * noise_.accel_noise_density * root_rate + kAccelShake;
  const bool quiet =
      sigma.head<3>().maxCoeff() < gyro_bound && sigma.tail<3>().maxCoeff() < accel_bound;
  const Vector3d turn = mean.head<3>() - bias_gyro;
  if (!quiet || !(turn.cwiseAbs().maxCoeff() < kTurn)) {
    return std::nullopt;
  }
  return StillInterval{.gyro_radps = mean.head<3>(), .duration = imu_.back().t - imu_.front().t};
}

}  // namespace geoflow::slam
