#include "src/imu_disturbance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/walk.hpp"

#include "src/shock.hpp"

namespace geoflow::simulator {
namespace {

/// Landings strike for 3 to 8 ms, and between this part of the hardest shock and all of it.
constexpr double kShortestPulseS = 3e-3;
constexpr double kLongestPulseS = 8e-3;
constexpr double kSoftest = 0.25;
/// How far a landing's resonance lies from the mount's, relative: it depends on the posture.
constexpr double kRingSpread = 0.25;

/// A burst's length against its mean.
constexpr double kShortestBurst = 0.5;
constexpr double kLongestBurst = 1.5;
/// Its vibrations: structural frequencies, above and below half the sampling rate.
constexpr std::size_t kVibrations = 4;
constexpr double kLowestHz = 6;
constexpr double kHighestHz = 120;
/// A saturating sensor rectifies strong vibration into an offset of about this part of it.
constexpr double kRectified = 0.1;
/// Gyroscope distortion for accelerometer distortion [rad/s per m/s^2].
constexpr double kGyroForAccel = 0.05;
/// A burst comes and goes within this time.
constexpr double kFadeS = 0.1;

/// Each axis between -1 and 1: shocks come from all directions.
Vector3d any_direction(RandomStream& random) {
  const double x = random.uniform(-1, 1);
  const double y = random.uniform(-1, 1);
  const double z = random.uniform(-1, 1);
  return {x, y, z};
}

}  // namespace

TouchdownShocks::TouchdownShocks(const Walk& walk, std::uint64_t seed, const ImuOptions& options) {
  if (options.shock_mps2 <= 0 && options.shock_gyro_radps <= 0) {
    return;
  }
  for (const Leg leg : kAllLegs) {
    const RandomStream source = RandomStream{seed, "imu.shock"}.at(static_cast<std::uint64_t>(leg));
    std::uint64_t step = 0;
    for (const Stance& stance : walk.stances(leg)) {
      if (stance.touchdown_s < 0) {
        continue;
      }
      RandomStream random = source.at(++step);
      const double pulse_s = random.uniform(kShortestPulseS, kLongestPulseS);
      const double ring_hz =
          options.shock_ring_hz * random.uniform(1 - kRingSpread, 1 + kRingSpread);
      const double hardness = random.uniform(kSoftest, 1);
      const Vector3d accel = any_direction(random);
      const Vector3d gyro = any_direction(random);
      strikes_.push_back({.shock = {stance.touchdown_s, pulse_s, ring_hz, options.shock_damping},
                          .accel_mps2 = options.shock_mps2 * hardness * accel,
                          .gyro_radps = options.shock_gyro_radps * hardness * gyro});
    }
  }
  std::ranges::sort(strikes_, {}, [](const Strike& strike) { return strike.shock.start_s(); });
}

ImuSample TouchdownShocks::at(double t_s) {
  ImuSample sum;
  while (first_ < strikes_.size() && strikes_[first_].shock.end_s() < t_s) {
    ++first_;
  }
  for (std::size_t i = first_; i < strikes_.size() && strikes_[i].shock.start_s() <= t_s; ++i) {
    const Strike& strike = strikes_[i];
    const Shock::Motion motion = strike.shock.at(t_s);
    sum.accel_mps2 += motion.acceleration * strike.accel_mps2;
    sum.gyro_radps += motion.velocity / strike.shock.impulse_mps() * strike.gyro_radps;
  }
  return sum;
}

FaultBursts::FaultBursts(double duration_s, std::uint64_t seed, const ImuOptions& options) {
  if (options.fault_interval_s <= 0 || options.fault_mps2 <= 0) {
    return;
  }
  const RandomStream source{seed, "imu.fault"};
  RandomStream gaps{seed, "imu.fault_gap"};
  const auto gap_s = [&] { return -options.fault_interval_s * std::log(1 - gaps.uniform()); };
  for (double t_s = gap_s(); t_s < duration_s;) {
    bursts_.push_back(burst(source.at(bursts_.size()), t_s, options));
    t_s = bursts_.back().end_s + gap_s();
  }
}

FaultBursts::Burst FaultBursts::burst(RandomStream random, double start_s,
                                      const ImuOptions& options) {
  Burst burst;
  burst.start_s = start_s;
  burst.end_s = start_s + options.fault_s * random.uniform(kShortestBurst, kLongestBurst);
  burst.accel_offset_mps2 = kRectified * options.fault_mps2 * any_direction(random);
  const double amplitude_mps2 = options.fault_mps2 / std::sqrt(static_cast<double>(kVibrations));
  for (std::size_t i = 0; i < kVibrations; ++i) {
    Vibration vibration;
    vibration.hz = kLowestHz * std::pow(kHighestHz / kLowestHz, random.uniform());
    vibration.phase_rad = random.uniform(0, 2 * std::numbers::pi);
    vibration.accel_mps2 = amplitude_mps2 * any_direction(random);
    vibration.gyro_radps = kGyroForAccel * amplitude_mps2 * any_direction(random);
    burst.vibrations.push_back(vibration);
  }
  return burst;
}

std::optional<ImuSample> FaultBursts::at(double t_s) const {
  const auto burst = std::ranges::find_if(
      bursts_, [&](const Burst& b) { return t_s >= b.start_s && t_s < b.end_s; });
  if (burst == bursts_.end()) {
    return std::nullopt;
  }
  const double strength =
      std::min({1.0, (t_s - burst->start_s) / kFadeS, (burst->end_s - t_s) / kFadeS});
  ImuSample sample;
  sample.accel_mps2 = strength * burst->accel_offset_mps2;
  for (const Vibration& vibration : burst->vibrations) {
    const double wave =
        strength * std::sin(2 * std::numbers::pi * vibration.hz * t_s + vibration.phase_rad);
    sample.accel_mps2 += wave * vibration.accel_mps2;
    sample.gyro_radps += wave * vibration.gyro_radps;
  }
  return sample;
}

}  // namespace geoflow::simulator
