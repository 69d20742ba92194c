#include "geoflow/tools/evaluate/pose_errors.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"

#include "scripted_pairs.hpp"

namespace geoflow::tools {
namespace {

using testing::ElementsAre;
using testing::Pair;
using namespace tests_evaluate;

/// Poses along x at these positions [m], one a second.
PosePairs along_x(const std::vector<double>& positions) {
  PosePairs pairs;
  for (const double x : positions) {
    pairs.push_back(
        pair_at(static_cast<double>(pairs.size()), Vector3d{x, 0, 0}, Vector3d{x, 0, 0}));
  }
  return pairs;
}

TEST(Statistics, AreThoseOfKnownNumbers) {
  const Statistics s = statistics({4, 1, 3, 2});
  EXPECT_EQ(s.count, 4U);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.sse, 30);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(1.25));
  EXPECT_DOUBLE_EQ(s.min, 1);
  EXPECT_DOUBLE_EQ(s.max, 4);
  EXPECT_DOUBLE_EQ(statistics({5, 1, 2}).median, 2);
  EXPECT_EQ(statistics({}).count, 0U);
}

TEST(AbsoluteErrors, AreDistanceAndAngle) {
  PosePair pair = pair_at(0, Vector3d{3, 4, 0}, Vector3d::Zero());
  pair.estimate = pair.estimate * SE3{so3::exp(Vector3d{0, 0.3, 0}), Vector3d::Zero()};
  const PoseErrors errors = absolute_errors({pair});
  EXPECT_DOUBLE_EQ(errors.translation_m.at(0), 5);
  EXPECT_NEAR(errors.rotation_rad.at(0), 0.3, 1e-12);
}

TEST(Stretches, InFrames) {
  const PosePairs pairs = along_x({0, 1, 2, 3, 4, 5});
  EXPECT_THAT(*stretches(pairs, {.delta = 2, .unit = DeltaUnit::kFrames}),
              ElementsAre(Pair(0, 2), Pair(2, 4)));
  EXPECT_THAT(*stretches(pairs, {.delta = 3, .unit = DeltaUnit::kFrames, .all_pairs = true}),
              ElementsAre(Pair(0, 3), Pair(1, 4), Pair(2, 5)));
  EXPECT_TRUE(stretches(pairs, {.delta = 6, .unit = DeltaUnit::kFrames})->empty());
}

TEST(Stretches, InMetres) {
  const PosePairs pairs = along_x({0, 1, 2.5, 2.0, 3, 6, 7});
  // Summed path 0 1 2.5 3 4 7 8: two metres are reached at poses 2, 5; then 1 m is left.
  EXPECT_THAT(*stretches(pairs, {.delta = 2, .unit = DeltaUnit::kMetres}), ElementsAre(Pair(2, 5)));
  // Within 0.25 * 2 m: 2.5 from 0, 2 from 1, 1.5 from 2; 3 to 4 is one metre, from 4 on there is 3
  // m or 1 m.
  EXPECT_THAT(
      *stretches(pairs,
                 {.delta = 2, .unit = DeltaUnit::kMetres, .all_pairs = true, .tolerance = 0.25}),
      ElementsAre(Pair(0, 2), Pair(1, 3), Pair(2, 4)));
}

TEST(Stretches, InSecondsSkipGaps) {
  PosePairs pairs = along_x({0, 1, 2, 3, 4});
  pairs[3].t += std::chrono::seconds{7};
  pairs[4].t += std::chrono::seconds{7};
  EXPECT_THAT(*stretches(pairs, {.delta = 1}), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(3, 4)));
  EXPECT_THAT(*stretches(pairs, {.delta = 2, .all_pairs = true}), ElementsAre(Pair(0, 2)));
}

TEST(Stretches, InDegrees) {
  PosePairs pairs = along_x({0, 1, 2, 3});
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double angle = 30.0 * static_cast<double>(i) * std::numbers::pi / 180.0;
    pairs[i].estimate = SE3{so3::exp(Vector3d{0, 0, angle}), Vector3d::Zero()};
  }
  EXPECT_THAT(*stretches(pairs, {.delta = 59, .unit = DeltaUnit::kDegrees}),
              ElementsAre(Pair(0, 2)));
  EXPECT_THAT(*stretches(pairs, {.delta = 60, .unit = DeltaUnit::kDegrees, .all_pairs = true}),
              ElementsAre(Pair(0, 2), Pair(1, 3)));
}

TEST(Stretches, RefuseOptionsOutOfRange) {
  const PosePairs pairs = along_x({0, 1});
  for (const RelativeOptions& options :
       {RelativeOptions{.delta = 0}, RelativeOptions{.delta = std::nan("")},
        RelativeOptions{.delta = std::numeric_limits<double>::infinity()},
        RelativeOptions{.delta = 1.5, .unit = DeltaUnit::kFrames},
        RelativeOptions{.delta = 1e30, .unit = DeltaUnit::kFrames},
        RelativeOptions{.delta = 181, .unit = DeltaUnit::kDegrees},
        RelativeOptions{.tolerance = -1}}) {
    const auto found = stretches(pairs, options);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(RelativeErrors, AreThoseOfTheMotionAndDoNotDependOnTheFrames) {
  EXPECT_TRUE(
      rc::check("relative errors are invariant under SE(3) on either side", [](std::uint64_t seed) {
        PosePairs pairs = random_pairs(seed, 6);
        std::mt19937_64 random{seed};
        const SE3 error = SE3::exp(0.1 * random_transform(random).log());
        // The estimate gains `error` after the third pose.
        for (std::size_t i = 3; i < pairs.size(); ++i) {
          const SE3 T_ref2_refi = pairs[2].reference.inverse() * pairs[i].reference;
          pairs[i] = {.t = pairs[i].t,
                      .estimate = pairs[2].estimate * error * T_ref2_refi,
                      .reference = pairs[i].reference};
        }
        const PosePairs moved = transformed({.T_ref_est = random_transform(random)}, pairs);
        const IndexPairs all = stretches(moved, {.delta = 1, .unit = DeltaUnit::kFrames}).value();
        const PoseErrors errors = relative_errors(moved, all);
        for (std::size_t i = 0; i < all.size(); ++i) {
          // The motion from 2 to 3 is error * T, its error T^-1 * error * T.
          const SE3 T = pairs[2].reference.inverse() * pairs[3].reference;
          const SE3 expected = i == 2 ? T.inverse() * error * T : SE3{};
          RC_ASSERT(std::abs(errors.translation_m[i] - expected.translation().norm()) < 1e-9);
          RC_ASSERT(std::abs(errors.rotation_rad[i] - so3::log(expected.rotation()).norm()) < 1e-7);
        }
      }));
}

TEST(CorrectRate, CountsTimeThatPosesVouchFor) {
  PosePairs pairs;
  for (const double t : {0.0, 0.5, 1.0, 5.0, 5.5}) {
    pairs.push_back(pair_at(t, Vector3d{t == 0.5 ? 0.2 : 0.0, 0, 0}, Vector3d::Zero()));
  }
  const HostTime begin{};
  const HostTime end{std::chrono::seconds{10}};
  // 0.5 + 0.5 + 1 (of 4) + 0.5 + 1 (of 4.5) seconds of 10.
  EXPECT_DOUBLE_EQ(correct_rate(pairs, begin, end, {}), 0.35);
  EXPECT_DOUBLE_EQ(correct_rate(pairs, begin, end, {.max_error_m = 0.1}), 0.30);
  EXPECT_DOUBLE_EQ(correct_rate(pairs, begin, end, {.max_gap = std::chrono::seconds{100}}), 1.0);
  EXPECT_DOUBLE_EQ(correct_rate(pairs, begin, begin, {}), 1.0);
}

TEST(PathLengths, AreSums) {
  PosePairs pairs = along_x({0, 3, 1});
  pairs[2].estimate = SE3{};
  EXPECT_DOUBLE_EQ(path_lengths(pairs).reference_m, 5);
  EXPECT_DOUBLE_EQ(path_lengths(pairs).estimate_m, 6);
}

}  // namespace
}  // namespace geoflow::tools
