#include "imu/still_stretch.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "imu/uniform_series.hpp"
#include "noise.hpp"

namespace geoflow::calibration {
namespace {

using tests::lying_still;

StillStretch longest(const std::vector<Timed<ImuSample>>& samples) {
  const auto recording = make_uniform(samples);
  EXPECT_TRUE(recording.has_value());
  return longest_still(*recording);
}

TEST(StillStretch, IsAllOfARecordingThatLies) {
  const auto samples = lying_still(30, 1);
  const StillStretch stretch = longest(samples);
  EXPECT_EQ(stretch.begin, 0);
  EXPECT_EQ(stretch.end, samples.size());
}

TEST(StillStretch, IsTheLongerPartBeforeOrAfterAMotion) {
  auto samples = lying_still(30, 2);
  for (std::size_t i = 1600; i < 2000; ++i) {  // turns at 8 s to 10 s
    samples[i].sample.gyro_radps.z() += 0.1 * std::sin(0.01 * static_cast<double>(i));
  }
  const StillStretch stretch = longest(samples);
  EXPECT_GE(stretch.begin, 2000);
  EXPECT_LT(stretch.begin, 2100);
  EXPECT_EQ(stretch.end, samples.size());
}

TEST(StillStretch, EndsWhereItIsTilted) {
  auto samples = lying_still(30, 3);
  for (std::size_t i = 4000; i < samples.size(); ++i) {  // by 2 degrees from 20 s on
    samples[i].sample.accel_mps2.x() += 0.34;
  }
  const StillStretch stretch = longest(samples);
  EXPECT_EQ(stretch.begin, 0);
  EXPECT_LE(stretch.end, 4000);
  EXPECT_GT(stretch.end, 3900);
}

TEST(StillStretch, EndsWhereItIsShaken) {
  auto samples = lying_still(30, 4);
  for (std::size_t i = 0; i < 3000; ++i) {  // a motor runs until 15 s
    samples[i].sample.accel_mps2.y() += 0.3 * std::sin(0.9 * static_cast<double>(i));
  }
  const StillStretch stretch = longest(samples);
  EXPECT_GE(stretch.begin, 3000);
  EXPECT_EQ(stretch.end, samples.size());
}

TEST(UniformSeries, FillsShortGapsAndSplitsAtLongOnes) {
  auto samples = lying_still(4, 5);
  samples.erase(samples.begin() + 500, samples.begin() + 560);
  samples.erase(samples.begin() + 100, samples.begin() + 103);
  const auto recording = make_uniform(samples);
  ASSERT_TRUE(recording.has_value());
  EXPECT_DOUBLE_EQ(recording->period_s, 0.005);
  ASSERT_EQ(recording->pieces.size(), 2);
  EXPECT_EQ(recording->pieces[0].size(), 500);
  EXPECT_EQ(recording->pieces[1].size(), 240);
  const auto& filled = recording->pieces[0].filled;
  EXPECT_EQ(std::count(filled.begin(), filled.end(), true), 3);
  const auto& x = recording->pieces[0].axes[0];
  EXPECT_NEAR(x[101], x[99] + (x[103] - x[99]) / 2, 1e-12);
}

TEST(UniformSeries, NamesTheSampleThatCannotBe) {
  auto samples = lying_still(1, 6);
  samples[41].sample.gyro_radps.y() = std::numeric_limits<double>::quiet_NaN();
  auto refused = make_uniform(samples);
  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().message,
              testing::HasSubstr("sample 42 has a value that is no number"));
  samples = lying_still(1, 6);
  samples[7].t = samples[6].t;
  refused = make_uniform(samples);
  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().message, testing::HasSubstr("sample 8 is not later"));
}

}  // namespace
}  // namespace geoflow::calibration
