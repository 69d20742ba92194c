#include "geoflow/daemon/time_histogram.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

namespace geoflow::daemon {
namespace {

TEST(TimeHistogram, EmptyIsZero) {
  const TimeHistogram histogram;
  EXPECT_EQ(histogram.summary().count, 0U);
  EXPECT_EQ(histogram.summary().p99_ms, 0.0);
}

TEST(TimeHistogram, PercentilesAreWithinThreePercentOfTheSorted) {
  const auto seed = tests::test_seed(7);
  std::mt19937_64 random{seed};
  std::lognormal_distribution<double> milliseconds{2.0, 1.5};
  TimeHistogram histogram;
  std::vector<double> values;
  double sum = 0;
  for (int i = 0; i < 20000; ++i) {
    const Duration duration = from_seconds(milliseconds(random) * 1e-3);
    histogram.add(duration);
    values.push_back(to_seconds(duration) * 1e3);
    sum += values.back();
  }
  std::ranges::sort(values);
  const TimeSummary summary = histogram.summary();
  EXPECT_EQ(summary.count, values.size());
  EXPECT_NEAR(summary.mean_ms, sum / 20000.0, 1e-6) << seed;
  EXPECT_NEAR(summary.p50_ms, values[10000], values[10000] * 0.035 + 1e-3) << seed;
  EXPECT_NEAR(summary.p99_ms, values[19800], values[19800] * 0.035 + 1e-3) << seed;
  EXPECT_NEAR(summary.max_ms, values.back(), 1e-6) << seed;
}

TEST(TimeHistogram, BucketsHoldWhatWasAdded) {
  TimeHistogram histogram;
  histogram.add(std::chrono::microseconds{5});
  histogram.add(std::chrono::microseconds{5});
  histogram.add(std::chrono::milliseconds{40});
  const std::vector<TimeBucket> buckets = histogram.buckets();
  ASSERT_EQ(buckets.size(), 2U);
  EXPECT_EQ(buckets[0].count, 2U);
  EXPECT_DOUBLE_EQ(buckets[0].lower_ms, 0.005);
  EXPECT_DOUBLE_EQ(buckets[0].upper_ms, 0.006);
  EXPECT_EQ(buckets[1].count, 1U);
  EXPECT_LE(buckets[1].lower_ms, 40);
  EXPECT_GT(buckets[1].upper_ms, 40);
  EXPECT_LT(buckets[1].upper_ms / buckets[1].lower_ms, 1.035);
}

TEST(TimeHistogram, ExtremesStayInside) {
  TimeHistogram histogram;
  histogram.add(Duration{-5});
  histogram.add(Duration{0});
  histogram.add(std::chrono::hours{48});
  EXPECT_EQ(histogram.summary().count, 3U);
  EXPECT_DOUBLE_EQ(histogram.summary().max_ms, 48.0 * 3600e3);
  EXPECT_LE(histogram.summary().p50_ms, 0.0011);
}

}  // namespace
}  // namespace geoflow::daemon
