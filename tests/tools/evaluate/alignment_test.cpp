#include "geoflow/tools/evaluate/alignment.hpp"

#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"

#include "scripted_pairs.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;
using namespace tests_evaluate;

double ate_rmse(const PosePairs& pairs, Alignment alignment) {
  const auto found = align(pairs, alignment);
  if (!found) {
    throw std::runtime_error{found.error().message};
  }
  return statistics(absolute_errors(transformed(*found, pairs)).translation_m).rmse;
}

std::string alignment_error(const PosePairs& pairs, Alignment alignment) {
  const auto found = align(pairs, alignment);
  return found ? "no error" : found.error().message;
}

TEST(Align, FindsAKnownTransformAndScale) {
  EXPECT_TRUE(rc::check("Sim(3) and SE(3) are recovered", [](std::uint64_t seed) {
    PosePairs pairs = random_pairs(seed, 20);
    std::mt19937_64 random{seed + 1};
    const Similarity truth{.scale = std::uniform_real_distribution<double>{0.1, 10}(random),
                           .T_ref_est = random_transform(random)};
    for (PosePair& pair : pairs) {
      pair.reference = truth * pair.estimate;
    }
    const auto found = align(pairs, Alignment::kSim3);
    RC_ASSERT(found.has_value());
    RC_ASSERT(std::abs(found->scale / truth.scale - 1) < 1e-9);
    RC_ASSERT((found->T_ref_est.inverse() * truth.T_ref_est).log().norm() < 1e-8);
    for (PosePair& pair : pairs) {
      pair.reference = truth.T_ref_est * pair.estimate;
    }
    const auto rigid = align(pairs, Alignment::kSe3);
    RC_ASSERT(rigid.has_value() && rigid->scale == 1.0);
    RC_ASSERT((rigid->T_ref_est.inverse() * truth.T_ref_est).log().norm() < 1e-8);
  }));
}

TEST(Align, DoesNotCareWhereTheEstimateStarts) {
  EXPECT_TRUE(rc::check("errors are invariant", [](std::uint64_t seed) {
    PosePairs pairs = random_pairs(seed, 15);
    std::mt19937_64 random{seed};
    std::normal_distribution<double> noise{0, 0.1};
    for (PosePair& pair : pairs) {
      pair.estimate =
          SE3{pair.estimate.rotation(),
              pair.estimate.translation() + Vector3d{noise(random), noise(random), noise(random)}};
    }
    PosePairs moved = transformed({.T_ref_est = random_transform(random)}, pairs);
    RC_ASSERT(std::abs(ate_rmse(pairs, Alignment::kSe3) - ate_rmse(moved, Alignment::kSe3)) < 1e-9);
    RC_ASSERT(std::abs(ate_rmse(pairs, Alignment::kOrigin) - ate_rmse(moved, Alignment::kOrigin)) <
              1e-9);
    moved = transformed({.scale = 3.7}, moved);
    RC_ASSERT(std::abs(ate_rmse(pairs, Alignment::kSim3) - ate_rmse(moved, Alignment::kSim3)) <
              1e-9);
    // The least squares solution is no worse than any other alignment.
    RC_ASSERT(ate_rmse(pairs, Alignment::kSe3) <= ate_rmse(pairs, Alignment::kNone) + 1e-12);
    RC_ASSERT(ate_rmse(pairs, Alignment::kSim3) <= ate_rmse(pairs, Alignment::kSe3) + 1e-12);
  }));
}

TEST(Align, GivesTheStandardDeviationOfTheNoise) {
  PosePairs pairs = random_pairs(7, 4000);
  std::mt19937_64 random{8};
  std::normal_distribution<double> noise{0, 0.02};
  for (PosePair& pair : pairs) {
    pair.estimate =
        SE3{pair.estimate.rotation(),
            pair.estimate.translation() + Vector3d{noise(random), noise(random), noise(random)}};
  }
  // 12,000 squares of noise: their mean is within 4 * sqrt(2 / 12000) = 5.2 % of its expectation.
  EXPECT_NEAR(ate_rmse(pairs, Alignment::kSe3), 0.02 * std::sqrt(3.0),
              0.03 * 0.02 * std::sqrt(3.0));
}

TEST(Align, NeverMirrors) {
  PosePairs pairs = random_pairs(3, 30);
  for (PosePair& pair : pairs) {
    const Vector3d p = pair.estimate.translation();
    pair.reference = SE3{Eigen::Quaterniond::Identity(), Vector3d{p.x(), p.y(), -p.z()}};
  }
  const auto found = align(pairs, Alignment::kSe3);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->T_ref_est.rotation_matrix().determinant(), 1.0, 1e-12);
}

TEST(Align, HandlesPathsInOnePlane) {
  PosePairs pairs;
  for (const double t : {0.0, 1.0, 2.0, 3.0}) {
    const Vector3d p{t, t * t, 0};
    pairs.push_back(pair_at(t, p, Vector3d{-p.y(), p.x(), 5}));
  }
  EXPECT_LT(ate_rmse(pairs, Alignment::kSe3), 1e-12);
}

TEST(Align, RefusesWhatLeavesTheRotationOpen) {
  PosePairs line;
  PosePairs still;
  for (const double t : {0.0, 1.0, 2.0, 3.0}) {
    line.push_back(pair_at(t, Vector3d{1.1 * t, 2.3 * t, 0.7 * t}, Vector3d{t, 0, t * t}));
    still.push_back(pair_at(t, Vector3d{1.1, 2.2, 3.3}, Vector3d{t, 0, t * t}));
  }
  for (const Alignment alignment : {Alignment::kSe3, Alignment::kSim3}) {
    EXPECT_THAT(alignment_error(line, alignment), HasSubstr("lie on one line"));
    EXPECT_THAT(alignment_error(still, alignment), HasSubstr("the estimate does not move"));
    EXPECT_THAT(alignment_error({line[0], line[1]}, alignment), HasSubstr("only 2 pairs"));
  }
  EXPECT_EQ(alignment_error(line, Alignment::kOrigin), "no error");
  EXPECT_EQ(alignment_error(still, Alignment::kNone), "no error");
  EXPECT_THAT(alignment_error({}, Alignment::kNone), HasSubstr("no pairs"));
}

}  // namespace
}  // namespace geoflow::tools
