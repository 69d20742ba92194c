#include "inertial/inertial_residual.hpp"

#include <chrono>
#include <random>
#include <string>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "slam/inertial/motion.hpp"

namespace geoflow::slam {
namespace {

using inertial_tests::SineMotion;
using std::chrono::milliseconds;

constexpr HostTime kBegin{milliseconds{200}};
constexpr HostTime kEnd{milliseconds{700}};

StateVector normal15(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  StateVector v;
  for (double& value : v) {
    value = normal(random);
  }
  return v;
}

struct Case {
  Preintegrated measured;
  NavState first;
  NavState second;
};

Case random_case(std::mt19937_64& random) {
  const SineMotion motion{random};
  const ImuBias bias{0.02 * inertial_tests::normal3(random), 0.2 * inertial_tests::normal3(random)};
  const auto samples =
      inertial_tests::noisy_samples(motion, kBegin, kEnd, bias, ImuNoise{}, random);
  Case made{*preintegrate(unscreened(samples), kBegin, kEnd, bias, ImuNoise{}),
            motion.state(kBegin), motion.state(kEnd)};
  made.first.bias = made.second.bias = bias;
  return made;
}

TEST(InertialResidual, JacobiansMatchDifferences) {
  std::mt19937_64 random{tests::test_seed(11)};
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 20; ++trial) {
    const Case at = random_case(random);
    const NavState first = at.first.plus(0.05 * normal15(random));
    const NavState second = at.second.plus(0.05 * normal15(random));
    const Vector3d gravity = gravity_down() + 0.1 * inertial_tests::normal3(random);
    const InertialResidual residual = inertial_residual(at.measured, first, second, gravity);
    const auto value = [&](const NavState& a, const NavState& b, const Vector3d& g) {
      return inertial_residual_value(at.measured, a, b, g);
    };
    for (int column = 0; column < kStateSize; ++column) {
      const StateVector d = kStep * StateVector::Unit(column);
      const StateVector by_first =
          (value(first.plus(d), second, gravity) - value(first.plus(-d), second, gravity)) /
          (2 * kStep);
      const StateVector by_second =
          (value(first, second.plus(d), gravity) - value(first, second.plus(-d), gravity)) /
          (2 * kStep);
      EXPECT_LT((by_first - residual.by_first.col(column)).norm(), 1e-6) << column;
      EXPECT_LT((by_second - residual.by_second.col(column)).norm(), 1e-6) << column;
    }
    for (int column = 0; column < 3; ++column) {
      const Vector3d d = kStep * Vector3d::Unit(column);
      const StateVector by_gravity =
          (value(first, second, gravity + d) - value(first, second, gravity - d)) / (2 * kStep);
      EXPECT_LT((by_gravity - residual.by_gravity.col(column)).norm(), 1e-6) << column;
    }
  }
}

TEST(InertialResidual, PredictionMakesItZero) {
  std::mt19937_64 random{tests::test_seed(12)};
  for (int trial = 0; trial < 20; ++trial) {
    const Case at = random_case(random);
    const NavState first = at.first.plus(0.02 * normal15(random));
    const UncertainState second =
        predict({first, StateMatrix::Zero()}, at.measured, gravity_down());
    EXPECT_LT(inertial_residual_value(at.measured, first, second.state, gravity_down()).norm(),
              1e-12);
  }
}

/// Error of the predicted state over many runs, with a first state as wrong as its covariance says.
TEST(InertialResidual, PredictedCovarianceIsConsistent) {
  std::mt19937_64 random{tests::test_seed(13)};
  StateVector sigma;
  sigma << Vector3d::Constant(0.01), Vector3d::Constant(0.02), Vector3d::Constant(0.05),
      Vector3d::Constant(0.003), Vector3d::Constant(0.05);
  ImuNoise noise;
  noise.gyro_random_walk = noise.accel_random_walk = 1e-6;  // the simulation has none
  double nees = 0;
  constexpr int kRuns = 600;
  for (int run = 0; run < kRuns; ++run) {
    const SineMotion motion{random};
    const auto samples = inertial_tests::noisy_samples(motion, kBegin, kEnd, {}, noise, random);
    const NavState first = motion.state(kBegin).plus(sigma.cwiseProduct(normal15(random)));
    const auto measured = preintegrate(unscreened(samples), kBegin, kEnd, first.bias, noise);
    ASSERT_TRUE(measured.has_value());
    const UncertainState second =
        predict({first, StateMatrix{sigma.cwiseAbs2().asDiagonal()}}, *measured, gravity_down());
    const StateVector error = motion.state(kEnd).minus(second.state);
    nees += error.dot(second.covariance.ldlt().solve(error)) / kStateSize / kRuns;
  }
  RecordProperty("nees_per_dof", std::to_string(nees));
  EXPECT_GT(nees, 0.9);
  EXPECT_LT(nees, 1.1);
}

}  // namespace
}  // namespace geoflow::slam
