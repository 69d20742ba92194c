#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/calibration/imu_noise.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::calibration {
namespace {

/// What the IMU of a simulated robot says that stands and does not sway.
std::vector<Timed<ImuSample>> standing(double duration_s, std::uint64_t seed,
                                       const simulator::ImuOptions& options) {
  const std::array<Vector2d, 2> line{Vector2d{0, 0}, Vector2d{1, 0}};
  const auto walk = simulator::plan_walk(
      line, {.seed = seed, .duration_s = duration_s, .speed_mps = 0, .wander = 0});
  EXPECT_TRUE(walk.has_value());
  std::vector<Timed<ImuSample>> samples;
  for (const auto& reading : simulator::ImuSimulator{*walk, SE3{}, seed, options}.readings()) {
    samples.push_back({.t = HostTime{from_seconds(reading.t_s)}, .sample = reading.sample});
  }
  return samples;
}

TEST(SimulatedImuNoise, IsWithinThreeSigmasOnTwentySeeds) {
  simulator::ImuOptions options = simulator::exact_imu();
  options.noise_scale = 1;
  const auto power = [](double density) { return density * density; };
  int total = 0;
  int within = 0;
  double worst_white = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto estimate = estimate_imu_noise(standing(120, seed, options), {});
    ASSERT_TRUE(estimate.has_value()) << estimate.error().message;
    for (std::size_t axis = 0; axis < 6; ++axis) {
      const bool accel = axis < 3;
      const NoiseTerms& terms = estimate->axes.at(axis).terms;
      const double white =
          accel ? options.noise.accel_noise_density : options.noise.gyro_noise_density;
      const double walk = accel ? options.noise.accel_random_walk : options.noise.gyro_random_walk;
      const auto count = [&](const NoiseTerm& term, double truth) {
        ++total;
        within += std::abs(term.power - truth) <= 3 * term.power_sigma ? 1 : 0;
      };
      count(terms.white, power(white));
      count(terms.bias_instability, 0);
      count(terms.random_walk, power(walk));
      worst_white = std::max(worst_white, std::abs(terms.white.value() / white - 1));
    }
  }
  RecordProperty("within_3_sigma", std::to_string(within) + " of " + std::to_string(total));
  RecordProperty("worst_white_noise_error", std::to_string(worst_white));
  EXPECT_GE(within, total * 95 / 100);
  EXPECT_LT(worst_white, 0.05);
}

TEST(SimulatedImuNoise, OfTheWholeSensorIsWithinFivePercent) {
  const simulator::ImuOptions options;  // rounded to its steps, with biases and scale errors
  const auto estimate = estimate_imu_noise(standing(90, 5, options), {});
  ASSERT_TRUE(estimate.has_value()) << estimate.error().message;
  EXPECT_NEAR(estimate->accel.white.value() / options.noise.accel_noise_density, 1, 0.05);
  EXPECT_NEAR(estimate->gyro.white.value() / options.noise.gyro_noise_density, 1, 0.05);
}

TEST(SimulatedImuNoise, OfAWalkIsRefused) {
  const std::array<Vector2d, 2> line{Vector2d{0, 0}, Vector2d{5, 0}};
  const auto walk = simulator::plan_walk(line, {.seed = 1, .duration_s = 80});
  ASSERT_TRUE(walk.has_value());
  std::vector<Timed<ImuSample>> samples;
  for (const auto& reading : simulator::ImuSimulator{*walk, SE3{}, 1, {}}.readings()) {
    samples.push_back({.t = HostTime{from_seconds(reading.t_s)}, .sample = reading.sample});
  }
  const auto estimate = estimate_imu_noise(samples, {});
  ASSERT_FALSE(estimate.has_value());
  EXPECT_NE(estimate.error().message.find("it moves"), std::string::npos);
}

}  // namespace
}  // namespace geoflow::calibration
