#include "report/streams.hpp"

#include <gtest/gtest.h>

namespace geoflow::tools {
namespace {

TEST(FindGaps, CountsWhatIsMissing) {
  const StreamGaps gaps =
      find_gaps({.name = "imu", .t_s = {0, 0.01, 0.02, 0.03, 0.07, 0.08, 0.10, 0.11}});
  EXPECT_NEAR(gaps.median_ms, 10, 1e-9);
  EXPECT_NEAR(gaps.longest_ms, 40, 1e-9);
  EXPECT_EQ(gaps.gaps, 2U);
  EXPECT_EQ(gaps.missing, 4U);
}

TEST(FindGaps, JitterIsNone) {
  const StreamGaps gaps = find_gaps({.name = "color", .t_s = {0, 0.030, 0.070, 0.099, 0.132}});
  EXPECT_EQ(gaps.gaps, 0U);
  EXPECT_EQ(gaps.missing, 0U);
}

TEST(FindGaps, ASingleSampleHasNone) {
  EXPECT_EQ(find_gaps({.name = "legs", .t_s = {0}}).longest_ms, 0.0);
  EXPECT_EQ(find_gaps({.name = "legs", .t_s = {}}).gaps, 0U);
}

TEST(FindGaps, TimesThatAreAllTheSameAreNoGaps) {
  EXPECT_EQ(find_gaps({.name = "legs", .t_s = {0, 0, 0, 1}}).gaps, 0U);
}

TEST(IntervalFigure, DrawsStreamsOfAnyLength) {
  const RecordingTimes times{
      .streams = {{.name = "color", .t_s = {0}}, {.name = "imu", .t_s = {0, 0.5, 0.75}}}};
  const Figure figure = interval_figure(times);
  ASSERT_EQ(figure.axes.size(), 2U);
  EXPECT_TRUE(figure.axes[0].series[0].x.empty());
  EXPECT_EQ(figure.axes[1].series[0].y, (std::vector<double>{500, 250}));
}

}  // namespace
}  // namespace geoflow::tools
