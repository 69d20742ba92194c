#include "inertial/screen.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "slam/inertial/motion.hpp"

namespace geoflow::slam {
namespace {

using Samples = std::vector<Timed<ImuSample>>;
using std::chrono::milliseconds;

constexpr HostTime kBegin{};
constexpr HostTime kEnd{milliseconds{1000}};

Samples trot(std::uint64_t seed) {
  std::mt19937_64 random{tests::test_seed(seed)};
  const inertial_tests::SineMotion motion{random};
  return inertial_tests::noisy_samples(motion, kBegin, kEnd, {}, ImuNoise{}, random);
}

/// Screens in packets of `stride` samples that overlap as SyncedPacket's do: the sample at or
/// before the interval and the one after it are in both. Returns each sample as it was judged last.
std::vector<InertialSample> in_packets(ImuScreen& screen, const Samples& samples,
                                       std::size_t stride) {
  std::vector<InertialSample> result;
  for (std::size_t first = 0; first + 1 < samples.size(); first += stride) {
    const std::size_t count = std::min(stride + 2, samples.size() - first);
    for (const InertialSample& judged : screen.screen(std::span{samples}.subspan(first, count))) {
      while (!result.empty() && result.back().t >= judged.t) {
        result.pop_back();
      }
      result.push_back(judged);
    }
  }
  return result;
}

TEST(ImuScreen, PassesACleanSignalAsItIs) {
  const Samples samples = trot(51);
  ImuScreen screen{ImuNoise{}};
  const auto judged = in_packets(screen, samples, 7);
  ASSERT_EQ(judged.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(judged[i].sample.gyro_radps, samples[i].sample.gyro_radps);
    EXPECT_EQ(judged[i].sample.accel_mps2, samples[i].sample.accel_mps2);
  }
  EXPECT_EQ(screen.counters().samples, samples.size());
  EXPECT_EQ(screen.counters().repaired + screen.counters().saturated + screen.counters().stuck +
                screen.counters().gaps + screen.counters().shocks,
            0);
}

TEST(ImuScreen, ATouchdownIsKeptAndAnIsolatedShockIsTrustedLess) {
  Samples samples = trot(52);
  samples[80].sample.accel_mps2.z() += 12;  // a touchdown: several samples
  samples[81].sample.accel_mps2.z() += 25;
  samples[82].sample.accel_mps2.z() += 14;
  samples[150].sample.accel_mps2.z() += 25;  // all in one sample
  ImuScreen screen{ImuNoise{}};
  const auto judged = in_packets(screen, samples, 7);
  ASSERT_EQ(judged.size(), samples.size());
  for (const std::size_t i : {80U, 81U, 82U, 150U}) {
    EXPECT_EQ(judged[i].sample.accel_mps2, samples[i].sample.accel_mps2);
  }
  EXPECT_EQ(judged[81].accel_variance_m2ps4, 0);
  EXPECT_NEAR(std::sqrt(judged[150].accel_variance_m2ps4), 25, 1.5);
  EXPECT_EQ(judged[150].gyro_variance_radps2, 0);
  EXPECT_EQ(screen.counters().shocks, 1);
  EXPECT_EQ(screen.counters().repaired, 0);
}

/// A false spike within the accelerometer's range cannot be told from a shock: the covariance has
/// to hold it.
TEST(ImuScreen, AFalseSpikeStaysWithinTheCovariance) {
  std::mt19937_64 random{tests::test_seed(53)};
  for (int trial = 0; trial < 50; ++trial) {
    const inertial_tests::SineMotion motion{random};
    Samples samples = inertial_tests::noisy_samples(motion, kBegin, kEnd, {}, ImuNoise{}, random);
    samples[100].sample.accel_mps2.y() += 20 + trial % 10;
    ImuScreen screen{ImuNoise{}};
    const auto measured = preintegrate(screen.screen(samples), kBegin, kEnd, {}, ImuNoise{});
    ASSERT_TRUE(measured.has_value());
    const StateVector error = inertial_residual_value(*measured, motion.state(kBegin),
                                                      motion.state(kEnd), gravity_down());
    const Vector3d sigma = measured->covariance.diagonal().segment<3>(kVelocityAt).cwiseSqrt();
    EXPECT_LT(error.segment<3>(kVelocityAt).cwiseQuotient(sigma).cwiseAbs().maxCoeff(),
              4);  // of 150 values
  }
}

TEST(ImuScreen, AnImpossibleTurnIsReplacedByTheLine) {
  Samples samples = trot(54);
  const Samples clean = samples;
  samples[100].sample.gyro_radps.x() += 8;   // 1600 rad/s^2 there and back
  samples[120].sample.accel_mps2.x() = 400;  // ten times the range
  ImuScreen screen{ImuNoise{}};
  const auto judged = in_packets(screen, samples, 7);
  EXPECT_EQ(screen.counters().repaired, 2);
  EXPECT_LT((judged[100].sample.gyro_radps - clean[100].sample.gyro_radps).norm(), 0.2);
  EXPECT_LT((judged[120].sample.accel_mps2 - clean[120].sample.accel_mps2).norm(), 1.0);
  EXPECT_GT(judged[100].gyro_variance_radps2, 0);
}

TEST(ImuScreen, SaturationAddsTheNoiseOfWhatLiesBeyond) {
  Samples samples = trot(55);
  const ImuRange range;
  samples[100].sample.accel_mps2.z() = range.accel_mps2;
  samples[101].sample.accel_mps2.z() = range.accel_mps2;
  samples[60].sample.gyro_radps.y() = -range.gyro_radps;
  samples[61].sample.gyro_radps.y() = -range.gyro_radps;
  ImuScreen screen{ImuNoise{}, range};
  const auto judged = in_packets(screen, samples, 7);
  EXPECT_EQ(screen.counters().saturated, 4);
  EXPECT_NEAR(std::sqrt(judged[100].accel_variance_m2ps4), range.accel_mps2 / 4, 1e-9);
  EXPECT_NEAR(std::sqrt(judged[61].gyro_variance_radps2), range.gyro_radps / 4, 1e-9);
  EXPECT_EQ(judged[100].gyro_variance_radps2, 0);
}

TEST(ImuScreen, StuckValuesAndDamageAreLeftOut) {
  Samples samples = trot(56);
  for (std::size_t i = 101; i < 140; ++i) {
    samples[i].sample = samples[100].sample;
  }
  samples[30].sample.gyro_radps.z() = std::numeric_limits<double>::quiet_NaN();
  samples[31].sample.accel_mps2.z() = std::numeric_limits<double>::infinity();
  ImuScreen screen{ImuNoise{}};
  const auto judged = in_packets(screen, samples, 7);
  EXPECT_EQ(screen.counters().not_finite, 2);
  EXPECT_EQ(screen.counters().stuck, 30);  // 39 repeats, of which nine lie within 50 ms
  EXPECT_EQ(screen.counters().gaps, 1);    // where two were not finite
  EXPECT_EQ(judged.size(), samples.size() - 32);
  // What remains has a hole of 155 ms, which preintegration refuses to bridge.
  EXPECT_FALSE(preintegrate(judged, kBegin, kEnd, {}, ImuNoise{}).has_value());
}

TEST(ImuScreen, CountsAreTheSameHoweverPacketsAreCut) {
  Samples samples = trot(57);
  samples[100].sample.gyro_radps.x() += 8;
  samples[150].sample.accel_mps2.z() += 25;
  samples[40].sample.gyro_radps.z() = std::numeric_limits<double>::quiet_NaN();
  for (const std::size_t stride : {1U, 2U, 3U, 5U, 11U, 50U, 200U}) {
    ImuScreen screen{ImuNoise{}};
    in_packets(screen, samples, stride);
    EXPECT_EQ(screen.counters().samples, samples.size()) << stride;
    EXPECT_EQ(screen.counters().not_finite, 1) << stride;
    EXPECT_EQ(screen.counters().repaired, 1) << stride;
    EXPECT_EQ(screen.counters().shocks, 1) << stride;
  }
}

/// Real data: no sample of a Go1's walk with its touchdowns is replaced or left out.
TEST(ImuScreen, ChangesNothingOfARealWalk) {
  GEOFLOW_DATA_OR_SKIP(folder, "go1-legs");
  const Samples samples = inertial_tests::read_go1_imu(folder);
  ImuScreen screen{ImuNoise{}};
  const auto judged = in_packets(screen, samples, 7);
  ASSERT_EQ(judged.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(judged[i].sample.gyro_radps, samples[i].sample.gyro_radps);
    EXPECT_EQ(judged[i].sample.accel_mps2, samples[i].sample.accel_mps2);
  }
  const ScreenCounters& counters = screen.counters();
  RecordProperty("shocks", std::to_string(counters.shocks));
  EXPECT_EQ(counters.repaired, 0);
  EXPECT_EQ(counters.stuck, 0);
  EXPECT_LT(counters.shocks, samples.size() / 100);
}

}  // namespace
}  // namespace geoflow::slam
