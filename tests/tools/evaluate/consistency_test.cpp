#include "geoflow/tools/evaluate/consistency.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kPoses = 4000;

/// A walk with errors drawn from the covariance that is claimed of them, times `honesty`.
struct Walk {
  std::vector<PoseEstimate> estimates;
  Trajectory truth;
};

Walk walk(double honesty) {
  std::mt19937 random{5};  // NOLINT(cert-msc51-cpp): the same every time
  std::normal_distribution<double> normal;
  Matrix6d root = Matrix6d::Zero();
  root.diagonal() << 0.01, 0.02, 0.03, 0.02, 0.05, 0.1;
  root(3, 1) = 0.04;  // position and rotation go together
  const SE3 T_odom_ref = SE3::exp((Vector6d{} << 0.3, -0.2, 1, 4, 5, -6).finished());
  Walk made;
  for (std::size_t i = 0; i < kPoses; ++i) {
    const auto s = static_cast<double>(i);
    const SE3 pose = SE3::exp((Vector6d{} << 0, 0.1, 0.01 * s, 0.02 * s, 0, 0).finished());
    Vector6d drawn = Vector6d::Zero();
    if (i > 0) {
      for (double& value : drawn) {
        value = normal(random);
      }
    }
    PoseEstimate estimate;
    estimate.t = HostTime{std::chrono::milliseconds{33 * i}};
    estimate.T_odom_base = T_odom_ref * pose * SE3::exp(root * drawn);
    estimate.covariance = root * root.transpose() * honesty;
    estimate.status = i % 4 == 3 ? TrackingStatus::kDegraded : TrackingStatus::kTracking;
    made.truth.push_back({estimate.t, pose});
    made.estimates.push_back(estimate);
  }
  return made;
}

TEST(Consistency, IsOneWhereTheCovarianceIsTheErrors) {
  const Walk made = walk(1);
  const auto errors = normalised_errors(made.estimates, made.truth, {});
  ASSERT_TRUE(errors) << errors.error().message;
  const Consistency found = consistency(*errors);
  EXPECT_EQ(found.of(TrackingStatus::kTracking).estimates, kPoses * 3 / 4 - 1);
  EXPECT_EQ(found.of(TrackingStatus::kDegraded).estimates, kPoses / 4);
  EXPECT_EQ(found.of(TrackingStatus::kLost).estimates, 0U);
  // A mean over n estimates of k degrees of freedom has a deviation of sqrt(2 / (k n)).
  for (const TrackingStatus status : {TrackingStatus::kTracking, TrackingStatus::kDegraded}) {
    const Nees& nees = found.of(status);
    EXPECT_NEAR(nees.position, 1, 0.1);
    EXPECT_NEAR(nees.orientation, 1, 0.1);
    EXPECT_NEAR(nees.pose, 1, 0.08);
    EXPECT_NEAR(nees.within_95, 0.95, 0.025);
  }
}

TEST(Consistency, SeesWhatPromisesTooMuch) {
  const Walk made = walk(0.25);
  const auto errors = normalised_errors(made.estimates, made.truth, {});
  ASSERT_TRUE(errors);
  const Consistency found = consistency(*errors);
  EXPECT_NEAR(found.of(TrackingStatus::kTracking).pose, 4, 0.2);
  EXPECT_LT(found.of(TrackingStatus::kTracking).within_95, 0.6);
}

TEST(Consistency, TellsEachErrorBesideItsDeviation) {
  const Walk made = walk(1);
  const auto errors = normalised_errors(made.estimates, made.truth, {});
  ASSERT_TRUE(errors);
  ASSERT_EQ(errors->size(), kPoses - 1);
  EXPECT_EQ(errors->front().t, made.truth[1].t);
  EXPECT_EQ(errors->at(2).status, TrackingStatus::kDegraded);
  std::size_t within = 0;
  for (const NormalisedError& one : *errors) {
    EXPECT_NEAR(one.sigma[2], 0.03, 1e-12);
    EXPECT_NEAR(one.sigma[3], std::hypot(0.02, 0.04), 1e-12);
    within += std::abs(one.error[4]) <= one.sigma[4] ? 1U : 0U;
  }
  // 68.3 % of a normal distribution lie within one deviation.
  EXPECT_NEAR(static_cast<double>(within) / static_cast<double>(errors->size()), 0.683, 0.03);
}

TEST(Consistency, ACovarianceThatIsNoneIsRefused) {
  Walk made = walk(1);
  made.estimates[7].covariance.setZero();
  const auto found = normalised_errors(made.estimates, made.truth, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message,
              testing::HasSubstr("at 231000000 ns is not positive definite"));
}

}  // namespace
}  // namespace geoflow::tools
