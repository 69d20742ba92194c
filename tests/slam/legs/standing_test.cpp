#include "legs/standing.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "recordings.hpp"

namespace geoflow::slam {
namespace {

/// Feeds half a second at 200 Hz: the IMU with its noise about `gyro`, the joints swinging by
/// `swing_rad`.
std::optional<StillInterval> half_a_second(const Vector3d& gyro, double swing_rad,
                                           const Vector3d& bias) {
  const ImuNoise noise;
  std::mt19937_64 random{tests::test_seed(21)};
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    return Vector3d{sigma * normal(random), sigma * normal(random), sigma * normal(random)};
  };
  StillnessDetector detector{noise};
  for (int k = 0; k <= 100; ++k) {
    const HostTime t = tests::at_seconds(0.005 * k);
    const double root_rate = std::sqrt(noise.rate_hz);
    detector.add(t, ImuSample{.accel_mps2 = Vector3d{0, 0, 9.8} +
                                            vector(noise.accel_noise_density * root_rate),
                              .gyro_radps = gyro + vector(noise.gyro_noise_density * root_rate)});
    LegSample legs;
    legs.joints[4].q_rad = swing_rad * std::sin(0.05 * k);
    detector.add(t, legs);
  }
  return detector.still(bias);
}

TEST(Stillness, ANoisyImuOnAStandingRobotIsStill) {
  const auto still = half_a_second(Vector3d{0.01, 0, 0}, 0.001, Vector3d::Zero());
  ASSERT_TRUE(still);
  EXPECT_NEAR(still->gyro_radps.x(), 0.01, 0.01);  // 0.0024 / sqrt(0.3 s), twice
  EXPECT_GE(still->duration, std::chrono::milliseconds{300});
}

TEST(Stillness, MovingJointsOrATurnAreNot) {
  EXPECT_FALSE(half_a_second(Vector3d::Zero(), 0.05, Vector3d::Zero()));
  EXPECT_FALSE(half_a_second(Vector3d{0, 0, 0.1}, 0.0, Vector3d::Zero()));
  EXPECT_TRUE(half_a_second(Vector3d{0, 0, 0.1}, 0.0, Vector3d{0, 0, 0.1}));
}

TEST(Stillness, ARealWalkHasNone) {
  GEOFLOW_DATA_OR_SKIP(folder, "go1-legs");
  const tests::WalkRecording walk = tests::read_go1_walk(folder);
  StillnessDetector detector{ImuNoise{}};
  int lying = 0;
  int walking = 0;
  for (std::size_t k = 0; k < walk.imu.size(); ++k) {
    detector.add(walk.imu[k].t, walk.imu[k].sample);
    detector.add(walk.legs[k].t, walk.legs[k].sample);
    if (detector.still(Vector3d::Zero())) {
      (walk.imu[k].t < tests::at_seconds(1.2) ? lying : walking) +=
          walk.imu[k].t > tests::at_seconds(6) || walk.imu[k].t < tests::at_seconds(1.2) ? 1 : 0;
    }
  }
  EXPECT_GT(lying, 150);  // of 180 samples that have a full window behind them
  EXPECT_EQ(walking, 0);
}

}  // namespace
}  // namespace geoflow::slam
