#include "cloud/gicp.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "synthetic_scene.hpp"
#include "views.hpp"

namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

TEST(Gicp, FindsKnownMotionsFromIdentity) {
  const DepthCloud target = view(room(), SE3{}, 1);
  std::uint64_t seed = 2;
  for (const SE3& T : {motion({0.01, -0.02, 0.005}, {0.01, -0.005, 0.02}),
                       motion({-0.03, 0.02, 0.03}, {-0.03, 0.02, 0.04}),
                       motion({0.02, 0.07, -0.02}, {0.05, -0.02, -0.05})}) {
    const RegistrationResult result = register_clouds(view(room(), T, seed++), target, SE3{}, {});
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 0);
    EXPECT_LT(distance_between(result.T_target_source, T), 3e-3);
    EXPECT_LT(angle_between(result.T_target_source, T), 1.5e-3);
  }
}

TEST(Gicp, BothDirectionsAgree) {
  const DepthCloud a = view(room(), SE3{}, 1);
  const DepthCloud b = view(room(), motion({0.01, 0.02, -0.01}, {0.02, 0.01, 0.01}), 2);
  const SE3 there = register_clouds(b, a, SE3{}, {}).T_target_source;
  const SE3 back = register_clouds(a, b, SE3{}, {}).T_target_source;
  EXPECT_LT(distance_between(there * back, SE3{}), 2e-3);
  EXPECT_LT(angle_between(there * back, SE3{}), 1e-3);
}

TEST(Gicp, AnswerDoesNotDependOnTheGuess) {
  const DepthCloud target = view(room(), SE3{}, 1);
  const SE3 T = motion({0.01, 0.02, -0.01}, {0.02, 0.01, 0.01});
  const DepthCloud source = view(room(), T, 2);
  const SE3 from_identity = register_clouds(source, target, SE3{}, {}).T_target_source;
  const SE3 from_truth = register_clouds(source, target, T, {}).T_target_source;
  EXPECT_LT(distance_between(from_identity, from_truth), 5e-4);
  EXPECT_LT(angle_between(from_identity, from_truth), 3e-4);
}

/// The gradient and its derivative against differences of the cost. They leave out how the common
/// normal turns with the pose and how pairs change, as all ICP does, so the agreement is to a few
/// per cent.
TEST(Gicp, SystemIsTheDerivativeOfTheCost) {
  const DepthCloud target = view(room(), SE3{}, 1, {});
  const SE3 T_true = motion({0.005, 0.008, -0.004}, {0.01, 0.005, 0.01});
  const DepthCloud source = view(room(), T_true, 2, {});
  GicpConfig config;
  config.kernel_sigmas = 1e3;
  const SE3 T = T_true * motion({0.002, -0.001, 0.001}, {0.003, 0.002, -0.002});
  const NormalEquations system = linearise(source, target, T, config);
  Vector6d numeric;
  Matrix6d H_numeric;
  for (int i = 0; i < 6; ++i) {
    constexpr double kStep = 2e-4;
    const Vector6d step = kStep * Vector6d::Unit(i);
    const NormalEquations plus = linearise(source, target, T * SE3::exp(step), config);
    const NormalEquations minus = linearise(source, target, T * SE3::exp(-step), config);
    numeric[i] = (plus.cost - minus.cost) / (2 * kStep);
    H_numeric.col(i) = (plus.b - minus.b) / (2 * kStep);
  }
  EXPECT_LT((numeric - system.b).norm(), 0.05 * system.b.norm());
  EXPECT_LT((H_numeric - system.H).norm(), 0.05 * system.H.norm());
}

TEST(Gicp, SystemsAddUp) {
  const DepthCloud target = view(room(), SE3{}, 1);
  const DepthCloud source = view(room(), motion({0, 0.01, 0}, {0.01, 0, 0}), 2);
  NormalEquations sum = linearise(source, target, SE3{}, {});
  const NormalEquations one = sum;
  sum += one;
  EXPECT_EQ(sum.H, 2 * one.H);
  EXPECT_EQ(sum.b, 2 * one.b);
  EXPECT_EQ(sum.inliers, 2 * one.inliers);
}

TEST(Gicp, SelectionKeepsTheSystem) {
  const DepthCloud target = view(room(), SE3{}, 1);
  const DepthCloud source = view(room(), motion({0, 0.01, 0}, {0.01, 0, 0}), 2);
  const std::vector<SurfelSample> sample = select(source, 600);
  EXPECT_LE(sample.size(), 600U);
  EXPECT_GE(sample.size(), 500U);
  const Matrix6d all = linearise(source, target, SE3{}, {}).H;
  const Matrix6d some = linearise(source, sample, target, SE3{}, {}).H;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> ratio{some, all, Eigen::EigenvaluesOnly};
  EXPECT_GT(ratio.eigenvalues().minCoeff(), 0.6);
  EXPECT_LT(ratio.eigenvalues().maxCoeff(), 1.6);
  EXPECT_TRUE(select(source, 0).empty());
  EXPECT_TRUE(select(view({}, SE3{}), 100).empty());
}

TEST(Gicp, SameBitsWithOneAndTwoThreads) {
  const DepthCloud target = view(room(), SE3{}, 1);
  const DepthCloud source = view(room(), motion({0.01, 0.02, -0.01}, {0.02, 0.01, 0.01}), 2);
  std::vector<RegistrationResult> results;
  for (const std::size_t threads : {1U, 2U, 2U}) {
    const tbb::global_control limit{tbb::global_control::max_allowed_parallelism, threads};
    results.push_back(register_clouds(source, target, SE3{}, {}));
  }
  for (const RegistrationResult& result : results) {
    EXPECT_EQ(result.T_target_source.matrix(), results[0].T_target_source.matrix());
    EXPECT_EQ(result.information, results[0].information);
    EXPECT_EQ(result.rmse_m, results[0].rmse_m);
  }
}

TEST(Gicp, NothingToAlignIsNotConverged) {
  const DepthCloud empty = view({}, SE3{});
  const DepthCloud full = view(room(), SE3{});
  const SE3 guess = motion({0.1, 0, 0}, {0, 0.2, 0});
  const SE3 behind = motion({0, 3.0, 0}, {0, 0, 0});
  const SE3 nowhere{Eigen::Quaterniond::Identity(), Vector3d::Constant(std::nan(""))};
  for (const RegistrationResult& result :
       {register_clouds(empty, full, guess, {}), register_clouds(full, empty, guess, {}),
        register_clouds(empty, empty, guess, {}), register_clouds(full, full, behind, {}),
        register_clouds(full, full, nowhere, {})}) {
    EXPECT_FALSE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 6);
    EXPECT_EQ(result.information, Matrix6d::Zero());
  }
  EXPECT_EQ(register_clouds(empty, full, guess, {}).T_target_source.matrix(), guess.matrix());
}

}  // namespace
}  // namespace geoflow::slam
