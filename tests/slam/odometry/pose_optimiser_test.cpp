#include "odometry/pose_optimiser.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/depth_cloud.hpp"
#include "synthetic_scene.hpp"
#include "views.hpp"
#include "vision/camera_model.hpp"

/// Points in front of a camera, some of which move on their own.
namespace geoflow::slam {
namespace {

const CameraModel pinhole{
    {.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 319.5, .cy = 239.5}};

/// Matches of `still` points, seen from T_odom_cam, and of `moving` ones that have moved.
std::vector<VisualMatch> matches(const SE3& T_odom_cam, std::size_t still, std::size_t moving,
                                 const Vector3d& moved_m) {
  std::mt19937_64 random{7};
  std::uniform_real_distribution<double> across{-1.2, 1.2};
  std::uniform_real_distribution<double> along{2, 5};
  std::normal_distribution<double> noise_px{0, 0.3};
  std::vector<VisualMatch> found;
  for (std::size_t i = 0; i < still + moving; ++i) {
    const Vector3d p_odom{across(random), across(random), along(random)};
    const Vector3d now = i < still ? p_odom : Vector3d{p_odom + moved_m};
    const Vector2d pixel =
        pinhole.project(T_odom_cam.inverse() * now) + Vector2d{noise_px(random), noise_px(random)};
    found.push_back({.p_odom = p_odom, .pixel = pixel});
  }
  return found;
}

PosePrior prior_of(const SE3& T_odom_cam, double sigma_rad, double sigma_m) {
  Vector6d information;
  information << Vector3d::Constant(1 / (sigma_rad * sigma_rad)),
      Vector3d::Constant(1 / (sigma_m * sigma_m));
  return {.T_odom_cam = T_odom_cam, .information = information.asDiagonal()};
}

class PoseOptimiserTest : public testing::Test {
 protected:
  [[nodiscard]] double error_m(const PoseProblem& problem, const SE3& T_odom_cam) const {
    const PoseSolution solution = optimiser_.solve(problem, problem.prior.T_odom_cam);
    return (T_odom_cam.inverse() * solution.T_odom_cam).translation().norm();
  }
  PoseOptimiser optimiser_{{}, {}, {}, pinhole};
  SE3 T_odom_cam_{Eigen::Quaterniond{Eigen::AngleAxisd{0.02, Vector3d{0.3, 1, 0}.normalized()}},
                  Vector3d{0.03, -0.01, 0.05}};
};

TEST_F(PoseOptimiserTest, FindsThePoseWhateverThePriorSaysWhereMuchIsSeen) {
  const auto seen = matches(T_odom_cam_, 100, 0, Vector3d::Zero());
  EXPECT_LT(
      error_m({.matches = seen, .targets = {}, .prior = prior_of(SE3{}, 0.1, 0.1)}, T_odom_cam_),
      2e-3);
}

TEST_F(PoseOptimiserTest, ACrowdThatWalksDoesNotTakeThePoseAlongWhereLegsSayWhereItIs) {
  // People fill the image: two of three points walk on together by 0.2 m.
  const auto seen = matches(T_odom_cam_, 30, 60, Vector3d{0.15, 0, 0.13});
  const PosePrior prior = prior_of(T_odom_cam_, 0.002, 0.003);
  const auto alone = matches(T_odom_cam_, 30, 0, Vector3d::Zero());
  const double without =
      error_m({.matches = alone, .targets = {}, .prior = prior, .reckoned = prior}, T_odom_cam_);
  EXPECT_LT(without, 3e-3) << "what noise and the prior leave";
  EXPECT_NEAR(
      error_m({.matches = seen, .targets = {}, .prior = prior, .reckoned = prior}, T_odom_cam_),
      without, 1e-3);
  EXPECT_GT(error_m({.matches = seen, .targets = {}, .prior = prior}, T_odom_cam_), without + 2e-3);
}

/// Pixels of what a floor mirrors, seen first from odom, now from `T_odom_cam`: its depth is the
/// floor's, its way through the image that of something four times as far.
std::vector<VisualMatch> mirrored(const SE3& T_odom_cam, std::size_t count) {
  constexpr double kTimesAsFar = 4;
  constexpr double kNearness = 0.35;  // floor before the feet, not walls
  std::vector<VisualMatch> found = matches(T_odom_cam, 0, count, Vector3d::Zero());
  for (VisualMatch& match : found) {
    match.p_odom *= kNearness;
    match.pixel = pinhole.project(T_odom_cam.inverse() * (kTimesAsFar * match.p_odom));
  }
  return found;
}

TEST_F(PoseOptimiserTest, AMirrorImageDoesNotHoldThePoseBackWhereLegsKnowTheWaySinceTheKeyframe) {
  const SE3 T_odom_cam{Eigen::Quaterniond::Identity(), Vector3d{0, 0, 0.1}};
  auto seen = matches(T_odom_cam, 25, 0, Vector3d::Zero());
  for (const VisualMatch& match : mirrored(T_odom_cam, 50)) {
    seen.push_back(match);
  }
  // The frames before have been held back already, and this one's step is added to theirs.
  const PosePrior prior =
      prior_of({Eigen::Quaterniond::Identity(), Vector3d{0, 0, 0.06}}, 0.003, 0.02);
  const PosePrior reckoned = prior_of(T_odom_cam, 0.001, 0.003);
  const double by_step =
      error_m({.matches = seen, .targets = {}, .prior = prior, .reckoned = prior}, T_odom_cam);
  const double by_way =
      error_m({.matches = seen, .targets = {}, .prior = prior, .reckoned = reckoned}, T_odom_cam);
  RecordProperty("by_step_m", std::to_string(by_step));
  RecordProperty("by_way_m", std::to_string(by_way));
  EXPECT_GT(by_step, 0.02) << "the images hold it back by half of what they can";
  EXPECT_LT(by_way, by_step / 3);
}

TEST_F(PoseOptimiserTest, WhatTheGateLeavesOutIsNoInlierHoweverNoisyTheRestIs) {
  auto seen = matches(T_odom_cam_, 60, 0, Vector3d::Zero());
  constexpr std::size_t kSound = 40;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    // Noise of which 5 px are less than 2.4 standard deviations, but more than legs allow.
    const double along_px = i % 2 == 0 ? 2.0 : -2.0;
    seen[i].pixel += i < kSound ? Vector2d{along_px, -along_px} : Vector2d{5, 0};
  }
  const PosePrior prior = prior_of(T_odom_cam_, 0.002, 0.003);
  const PoseSolution solution = optimiser_.solve({.matches = seen,
                                                  .targets = {},
                                                  .prior = prior,
                                                  .reckoned = prior_of(T_odom_cam_, 1e-5, 1e-5)},
                                                 T_odom_cam_);
  ASSERT_GT(solution.pixel_sigma, 5 / 2.4) << "by their noise alone they would be inliers";
  EXPECT_EQ(solution.visual_inliers, kSound);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(solution.inlier[i], i < kSound) << i;
  }
}

TEST_F(PoseOptimiserTest, TheCovarianceIsThatOfTheErrors) {
  double normalised = 0;
  constexpr int kTries = 60;
  for (int i = 0; i < kTries; ++i) {
    std::mt19937_64 random{static_cast<std::uint64_t>(i)};
    std::normal_distribution<double> noise_px{0, 1};
    auto seen = matches(T_odom_cam_, 80, 0, Vector3d::Zero());
    for (VisualMatch& match : seen) {
      match.pixel = pinhole.project(T_odom_cam_.inverse() * match.p_odom) +
                    Vector2d{noise_px(random), noise_px(random)};
    }
    const PoseSolution solution = optimiser_.solve(
        {.matches = seen, .targets = {}, .prior = prior_of(T_odom_cam_, 1, 1)}, SE3{});
    const Vector6d error = (T_odom_cam_.inverse() * solution.T_odom_cam).log();
    normalised += error.dot(solution.covariance.inverse() * error) / 6;
  }
  EXPECT_GT(normalised / kTries, 0.7);
  EXPECT_LT(normalised / kTries, 1.4);
}

TEST_F(PoseOptimiserTest, DepthThatErrsAsTriangulationDoesHoldsThePoseNeitherBackNorPushesIt) {
  // Beyond a few metres a sensor errs by per cents: weighed by a sigma that grows with what was
  // measured, the nearer of two depths counts for more, and 2000 of them come out 25 mm too near.
  constexpr double kInverseSigma = 0.02;
  std::mt19937_64 random{11};
  std::normal_distribution<double> noise{0, kInverseSigma};
  auto seen = matches(T_odom_cam_, 2000, 0, Vector3d::Zero());
  for (VisualMatch& match : seen) {
    const Vector3d p_cam = T_odom_cam_.inverse() * match.p_odom;
    match.depth_m = 1 / (1 / p_cam.z() + noise(random));
    // Pixels that say nothing of the way forward leave it to depth alone.
    match.pixel = pinhole.project(p_cam);
  }
  const PosePrior prior = prior_of(T_odom_cam_, 1e-5, 1);
  PoseConfig blurred;
  blurred.pixel_sigma = 1e3;
  const PoseOptimiser by_depth{blurred, {.inverse_depth_sigma = kInverseSigma}, {}, pinhole};
  const PoseSolution solution =
      by_depth.solve({.matches = seen, .targets = {}, .prior = prior}, T_odom_cam_);
  const double along = (T_odom_cam_.inverse() * solution.T_odom_cam).translation().z();
  const double sigma = std::sqrt(solution.covariance(5, 5));
  RecordProperty("along_m", std::to_string(along));
  EXPECT_LT(sigma, 0.01);
  EXPECT_LT(std::abs(along), 3 * sigma);
}

TEST_F(PoseOptimiserTest, SomeoneWhoWalksTowardsTheCameraDoesNotMoveItWhereLegsSayThatItStands) {
  // A corridor without an end: of the way along it nothing tells but who walks there.
  const auto seen = [](double person_at_m, std::uint64_t seed) {
    tests::Scene scene = tests::corridor();
    scene.push_back({.normal = Vector3d::UnitZ(),
                     .offset = person_at_m,
                     .low = {-0.4, -0.9, 0},
                     .high = {0.4, 0.8, 10}});
    return tests::view(scene, SE3{}, seed, {.inverse_depth_sigma = 3e-3, .blur_px = 5});
  };
  const DepthCloud before = seen(2.0, 1);
  const DepthCloud now = seen(1.97, 2);
  const std::vector<DepthTarget> targets{{.cloud = &before, .T_odom_target = SE3{}}};
  const PosePrior prior = prior_of(SE3{}, 5e-4, 0.02);
  const PoseProblem trusting{.matches = {}, .cloud = &now, .targets = targets, .prior = prior};
  PoseProblem judging = trusting;
  judging.reckoned = prior_of(SE3{}, 5e-4, 2e-3);
  EXPECT_GT(error_m(trusting, SE3{}), 5e-3);
  EXPECT_LT(error_m(judging, SE3{}), 2e-3);
  const PoseSolution all = optimiser_.solve(trusting, SE3{});
  const PoseSolution agreed = optimiser_.solve(judging, SE3{});
  EXPECT_LT(agreed.sight(5, 5), 0.1 * all.sight(5, 5));
  EXPECT_GT(agreed.sight(3, 3), 0.9 * all.sight(3, 3)) << "walls still tell where they are";
}

}  // namespace
}  // namespace geoflow::slam
