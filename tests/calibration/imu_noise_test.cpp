#include "geoflow/calibration/imu_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "noise.hpp"

namespace geoflow::calibration {
namespace {

using testing::HasSubstr;
using tests::lying_still;

std::string refusal(const std::vector<Timed<ImuSample>>& samples,
                    const ImuNoiseOptions& options = {}) {
  const auto estimate = estimate_imu_noise(samples, options);
  return estimate ? "accepted" : estimate.error().message;
}

const Finding& named(const std::vector<Finding>& findings, const std::string& name) {
  const auto found = std::ranges::find(findings, name, &Finding::name);
  EXPECT_NE(found, findings.end()) << name;
  return *found;
}

TEST(ImuNoise, OfKnownWhiteNoise) {
  const auto estimate = estimate_imu_noise(lying_still(90, 1), {});
  ASSERT_TRUE(estimate.has_value()) << estimate.error().message;
  EXPECT_NEAR(estimate->rate_hz, 200, 1e-9);
  EXPECT_NEAR(estimate->accel.white.value() / (0.02 * std::sqrt(0.005)), 1, 0.02);
  EXPECT_NEAR(estimate->gyro.white.value() / (0.003 * std::sqrt(0.005)), 1, 0.02);
  const auto findings = judge(*estimate);
  EXPECT_EQ(findings.size(), 24);
  EXPECT_EQ(named(findings, "gyro_y.white_noise").verdict, Verdict::kPass);
  // It has none, and so only a bound is known.
  const Finding& walk = named(findings, "accel.random_walk");
  EXPECT_EQ(walk.verdict, Verdict::kWarn);
  EXPECT_FALSE(walk.sigma.has_value());
  EXPECT_THAT(walk.note, HasSubstr("below the value"));
  EXPECT_EQ(overall(findings), Verdict::kWarn);
}

TEST(ImuNoise, RefusesARecordingThatIsTooShort) {
  EXPECT_THAT(refusal(lying_still(20, 2)), HasSubstr("too short: it has 20.0 s"));
}

TEST(ImuNoise, RefusesARecordingThatMoves) {
  auto samples = lying_still(90, 3);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double t_s = static_cast<double>(i) * 0.005;
    if (t_s > 20 && t_s < 60) {
      samples[i].sample.gyro_radps.x() += 0.2 * std::sin(3 * t_s);
    }
  }
  const std::string message = refusal(samples);
  EXPECT_THAT(message, HasSubstr("it moves: the longest stretch of standing still is 29."));
  EXPECT_THAT(message, HasSubstr("from 60."));
}

TEST(ImuNoise, RefusesAnAxisThatIsStuck) {
  auto samples = lying_still(90, 4);
  for (auto& sample : samples) {
    sample.sample.accel_mps2.z() = 9.8;
  }
  EXPECT_THAT(refusal(samples), HasSubstr("accel_z says only 1 different values"));
}

TEST(ImuNoise, RefusesLosses) {
  auto samples = lying_still(90, 5);
  std::size_t index = 0;
  std::erase_if(samples, [&](const auto&) { return ++index % 50 == 0; });
  EXPECT_THAT(refusal(samples), HasSubstr("samples are missing"));
}

TEST(ImuNoise, WarnsOfAnAxisUnlikeTheOthers) {
  auto samples = lying_still(90, 6);
  for (auto& sample : samples) {
    sample.sample.gyro_radps.x() = 0.1 * (sample.sample.gyro_radps.x() - 0.001);
  }
  const auto estimate = estimate_imu_noise(samples, {});
  ASSERT_TRUE(estimate.has_value()) << estimate.error().message;
  const Finding odd = named(judge(*estimate), "gyro_x.white_noise");
  EXPECT_EQ(odd.verdict, Verdict::kWarn);
  EXPECT_THAT(odd.note, HasSubstr("times that of its sensor's other axes"));
}

/// A real Go1's body IMU.
std::vector<Timed<ImuSample>> read_go1(const std::filesystem::path& folder) {
  std::ifstream accel{folder / "Accel_body_IMU.csv"};
  std::ifstream gyro{folder / "Gyro_body_IMU.csv"};
  std::string accel_line;
  std::string gyro_line;
  std::getline(accel, accel_line);
  std::getline(gyro, gyro_line);
  std::vector<Timed<ImuSample>> samples;
  while (std::getline(accel, accel_line) && std::getline(gyro, gyro_line)) {
    double t_s = 0;
    Timed<ImuSample> sample{};
    Vector3d& a = sample.sample.accel_mps2;
    Vector3d& w = sample.sample.gyro_radps;
    EXPECT_EQ(std::sscanf(accel_line.c_str(), "%lf,%lf,%lf,%lf", &t_s, &a[0], &a[1], &a[2]), 4);
    EXPECT_EQ(std::sscanf(gyro_line.c_str(), "%lf,%lf,%lf,%lf", &t_s, &w[0], &w[1], &w[2]), 4);
    sample.t = HostTime{from_seconds(t_s)};
    samples.push_back(sample);
  }
  return samples;
}

TEST(ImuNoise, OfARealGo1BeforeItStandsUp) {
  GEOFLOW_DATA_OR_SKIP(folder, "go1-legs");
  const auto samples = read_go1(folder);
  EXPECT_THAT(refusal(samples), HasSubstr("too short: it has 25.0 s"));
  EXPECT_THAT(refusal(samples, {.min_still_s = 20}), HasSubstr("it moves"));
  // It lies for 1.4 s, shaken by something at 40 Hz: too little to tell white noise from that.
  EXPECT_THAT(refusal(samples, {.min_still_s = 1}), HasSubstr("white noise does not show"));
}

TEST(ImuNoise, OfARealGo1sImuIsWhiteFromAPeriodOfItsVibrationOn) {
  GEOFLOW_DATA_OR_SKIP(folder, "go1-legs");
  const auto samples = read_go1(folder);
  constexpr std::size_t kLies = 280;  // samples before it stands up
  const std::array<std::size_t, 2> factors{8, 16};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> accel;
    std::vector<double> gyro;
    for (std::size_t i = 0; i < kLies; ++i) {
      accel.push_back(samples[i].sample.accel_mps2[axis]);
      gyro.push_back(samples[i].sample.gyro_radps[axis]);
    }
    // sigma(tau) sqrt(tau) at 40 and 80 ms is one density: within the 25 % that so few samples
    // allow.
    const auto density = [&](const std::vector<double>& values) {
      const auto points = overlapping_allan(values, 0.005, factors);
      const double shorter = points[0].deviation * std::sqrt(points[0].tau_s);
      const double longer = points[1].deviation * std::sqrt(points[1].tau_s);
      EXPECT_NEAR(longer / shorter, 1, 0.25) << axis;
      return shorter;
    };
    const double accel_density = density(accel);
    const double gyro_density = density(gyro);
    RecordProperty("accel_" + std::to_string(axis), std::to_string(accel_density));
    RecordProperty("gyro_" + std::to_string(axis), std::to_string(gyro_density));
    // Of the size that IMUs of this class have (datasheets: 1 to 3 mm/s^2, 0.1 to 0.5 mrad/s).
    EXPECT_GT(accel_density, 1e-3);
    EXPECT_LT(accel_density, 3e-3);
    EXPECT_GT(gyro_density, 1e-4);
    EXPECT_LT(gyro_density, 5e-4);
  }
}

}  // namespace
}  // namespace geoflow::calibration
