#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// Noise of known densities.
namespace geoflow::calibration::tests {

struct Densities {
  double white = 0;        ///< N
  double random_walk = 0;  ///< K
};

/// One axis: white noise and a random walk.
inline std::vector<double> noise(const Densities& densities, std::size_t count, double period_s,
                                 std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<double> values(count);
  double bias = 0;
  for (double& value : values) {
    value = bias + densities.white / std::sqrt(period_s) * normal(random);
    bias += densities.random_walk * std::sqrt(period_s) * normal(random);
  }
  return values;
}

/// An IMU that lies still, at 200 Hz.
inline std::vector<Timed<ImuSample>> lying_still(double duration_s, std::uint64_t seed) {
  constexpr double kPeriodS = 0.005;
  std::mt19937_64 random{seed};
  std::normal_distribution<double> normal;
  const auto three = [&] { return Vector3d{normal(random), normal(random), normal(random)}; };
  std::vector<Timed<ImuSample>> samples;
  const auto count = static_cast<std::size_t>(duration_s / kPeriodS);
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d accel = Vector3d{0.1, -0.2, 9.8} + 0.02 * three();
    const Vector3d gyro = Vector3d{0.001, 0.002, -0.001} + 0.003 * three();
    samples.push_back({.t = HostTime{from_seconds(static_cast<double>(i) * kPeriodS)},
                       .sample = {.accel_mps2 = accel, .gyro_radps = gyro}});
  }
  return samples;
}

}  // namespace geoflow::calibration::tests
