#include "geoflow/tools/evaluate/association.hpp"

#include <chrono>
#include <initializer_list>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// Poses at these milliseconds whose x is the time.
Trajectory at(std::initializer_list<int> times_ms) {
  Trajectory poses;
  for (const int t : times_ms) {
    poses.push_back({.t = HostTime{milliseconds{t}},
                     .pose = SE3{Eigen::Quaterniond::Identity(), Vector3d{double(t), 0, 0}}});
  }
  return poses;
}

TEST(Associate, TakesTheNearestWithinTheLargestDifference) {
  const auto pairs = associate(at({0, 100, 200, 300}), at({4, 95, 108, 215, 400}), {});
  ASSERT_TRUE(pairs) << pairs.error().message;
  ASSERT_EQ(pairs->size(), 2U);
  EXPECT_EQ((*pairs)[0].reference.translation().x(), 4);
  EXPECT_EQ((*pairs)[1].estimate.translation().x(), 100);
  EXPECT_EQ((*pairs)[1].reference.translation().x(), 95);
  EXPECT_EQ((*pairs)[1].t, HostTime{milliseconds{100}});
}

TEST(Associate, IncludesTheLargestDifferenceItself) {
  EXPECT_EQ(associate(at({0}), at({10, 50}), {})->size(), 1U);
  EXPECT_FALSE(associate(at({0}), at({11, 50}), {}));
}

TEST(Associate, UsesEachPoseOnce) {
  const auto pairs = associate(at({100, 104}), at({0, 103, 300}), {});
  ASSERT_TRUE(pairs);
  ASSERT_EQ(pairs->size(), 1U);
  EXPECT_EQ(pairs->front().estimate.translation().x(), 104);
}

TEST(Associate, AddsTheOffsetToTheEstimate) {
  for (const auto& [estimate, reference] : {std::pair{at({0, 100}), at({500, 600, 700})},
                                            std::pair{at({0, 100, 200}), at({500, 600})}}) {
    const auto pairs = associate(estimate, reference, {.offset = milliseconds{500}});
    ASSERT_TRUE(pairs);
    ASSERT_EQ(pairs->size(), 2U);
    EXPECT_EQ((*pairs)[1].t, HostTime{milliseconds{600}});
    EXPECT_EQ((*pairs)[1].estimate.translation().x(), 100);
    EXPECT_EQ((*pairs)[1].reference.translation().x(), 600);
  }
}

TEST(Associate, SaysHowFarApartTheTimesAre) {
  const auto none = associate(at({0, 1000}), at({5000, 6000}), {});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("(0.000 s to 1.000 s, offset 0.000 s included)"));
  EXPECT_THAT(none.error().message, HasSubstr("(5.000 s to 6.000 s)"));
}

TEST(Associate, RefusesOptionsOutOfRange) {
  EXPECT_EQ(associate(at({0}), at({0}), {.max_difference = milliseconds{-1}}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(associate(at({0}), at({0}), {.offset = kMaxOffset + milliseconds{1}}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_THAT(associate({}, at({0}), {}).error().message, HasSubstr("the estimate holds no pose"));
}

TEST(AssociateFiles, PairsKittiLineByLine) {
  const auto one = parse_trajectory("1 0 0 4 0 1 0 5 0 0 1 6\n", "one");
  const auto two = parse_trajectory("1 0 0 4 0 1 0 5 0 0 1 6\n1 0 0 5 0 1 0 5 0 0 1 6\n", "two");
  const auto timed = parse_trajectory("0 0 0 0 0 0 0 1\n", "timed");
  ASSERT_TRUE(one && two && timed);
  EXPECT_EQ(associate(*two, *two, {.offset = std::chrono::seconds{5}})->size(), 2U);
  EXPECT_THAT(associate(*one, *two, {}).error().message,
              HasSubstr("the estimate has 1 poses and the reference 2"));
  EXPECT_THAT(associate(*one, *timed, {}).error().message,
              HasSubstr("the estimate is a KITTI file"));
  EXPECT_THAT(associate(*timed, *one, {}).error().message,
              HasSubstr("the reference is a KITTI file"));
}

}  // namespace
}  // namespace geoflow::tools
