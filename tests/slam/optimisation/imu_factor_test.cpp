#include "optimisation/imu_factor.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <random>
#include <vector>

#include <ceres/problem.h>
#include <ceres/solver.h>
#include <ceres/types.h>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "optimisation/factors.hpp"
#include "slam/inertial/motion.hpp"
#include "slam/optimisation/jacobian_check.hpp"

namespace geoflow::slam {
namespace {

using std::chrono::milliseconds;

constexpr HostTime kBegin{milliseconds{100}};
constexpr HostTime kEnd{milliseconds{500}};
const SE3 T_cam_imu = SE3::exp((Vector6d() << 0.1, -0.2, 0.05, -0.02, 0.005, 0.011).finished());

struct Case {
  Preintegrated measured;
  NavState first;
  NavState second;
};

Case random_case(std::mt19937_64& random, const ImuNoise& noise = {}) {
  const inertial_tests::SineMotion motion{random};
  const auto samples = inertial_tests::noisy_samples(motion, kBegin, kEnd, {}, noise, random);
  return {preintegrate(unscreened(samples), kBegin, kEnd, {}, noise).value(), motion.state(kBegin),
          motion.state(kEnd)};
}

std::vector<double> speed_of(const NavState& state) {
  const SpeedBlock block = speed_block(state);
  return {block.begin(), block.end()};
}

StateVector disturbance(std::mt19937_64& random, double scale) {
  StateVector delta;
  for (int i = 0; i < kStateSize; i += 3) {
    delta.segment<3>(i) = scale * inertial_tests::normal3(random);
  }
  return delta;
}

TEST(ImuFactor, JacobiansMatchDifferences) {
  std::mt19937_64 random{tests::test_seed(41)};
  for (int trial = 0; trial < 20; ++trial) {
    Case at = random_case(random);
    // A unit covariance, so that differences are not drowned in residuals of thousands.
    at.measured.covariance = StateMatrix::Identity() + 0.1 * StateMatrix::Ones();
    const NavState first = at.first.plus(disturbance(random, 0.05));
    const NavState second = at.second.plus(disturbance(random, 0.05));
    expect_jacobians(ImuFactor{at.measured, T_cam_imu, gravity_down()},
                     {block_of(first.T_odom_imu * T_cam_imu.inverse()), speed_of(first),
                      block_of(second.T_odom_imu * T_cam_imu.inverse()), speed_of(second)});
  }
}

TEST(ImuFactor, CostIsTheMahalanobisDistanceAndScalesWithTheVariance) {
  std::mt19937_64 random{tests::test_seed(42)};
  const Case at = random_case(random);
  const NavState second = at.second.plus(disturbance(random, 0.01));
  const auto cost = [&](double variance_scale, const NavState& end) {
    const ImuFactor factor{at.measured, T_cam_imu, gravity_down(), variance_scale};
    const PoseBlock pose0 = pose_block(at.first, T_cam_imu);
    const PoseBlock pose1 = pose_block(end, T_cam_imu);
    const SpeedBlock speed0 = speed_block(at.first);
    const SpeedBlock speed1 = speed_block(end);
    const std::array<const double*, 4> blocks{pose0.data(), speed0.data(), pose1.data(),
                                              speed1.data()};
    StateVector residuals;
    EXPECT_TRUE(factor.Evaluate(blocks.data(), residuals.data(), nullptr));
    return residuals.squaredNorm();
  };
  const StateVector r = inertial_residual_value(at.measured, at.first, second, gravity_down());
  const double expected = r.dot(at.measured.covariance.ldlt().solve(r));
  EXPECT_NEAR(cost(1, second), expected, 1e-4 * expected);
  NavState same_bias = second;
  same_bias.bias = at.first.bias;
  EXPECT_NEAR(cost(100, same_bias), cost(1, same_bias) / 100, 1e-9 * cost(1, same_bias));
}

TEST(ImuFactor, OptimisationFindsTheSecondStateAgain) {
  std::mt19937_64 random{tests::test_seed(43)};
  for (int trial = 0; trial < 5; ++trial) {
    ImuNoise noise;
    noise.gyro_random_walk = 0;  // what claims no walk must not break it
    const Case at = random_case(random, noise);
    const NavState expected =
        predict({at.first, StateMatrix::Zero()}, at.measured, gravity_down()).state;
    const NavState wrong = expected.plus(disturbance(random, 0.05));
    PoseBlock pose0 = pose_block(at.first, T_cam_imu);
    PoseBlock pose1 = pose_block(wrong, T_cam_imu);
    SpeedBlock speed0 = speed_block(at.first);
    SpeedBlock speed1 = speed_block(wrong);
    PoseManifold manifold;
    ImuFactor factor{at.measured, T_cam_imu, gravity_down()};
    ceres::Problem::Options borrowed;
    borrowed.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    borrowed.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem{borrowed};
    problem.AddParameterBlock(pose0.data(), kPoseSize, &manifold);
    problem.AddParameterBlock(pose1.data(), kPoseSize, &manifold);
    problem.AddResidualBlock(&factor, nullptr, pose0.data(), speed0.data(), pose1.data(),
                             speed1.data());
    problem.SetParameterBlockConstant(pose0.data());
    problem.SetParameterBlockConstant(speed0.data());
    ceres::Solver::Options options;
    options.function_tolerance = 0;
    options.gradient_tolerance = 1e-9;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    const NavState found = state_of(pose1.data(), speed1.data(), T_cam_imu);
    EXPECT_LT(expected.minus(found).norm(), 1e-6) << summary.BriefReport();
  }
}

}  // namespace
}  // namespace geoflow::slam
