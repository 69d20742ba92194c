#include "legs/leg_preintegration.hpp"

#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "tests/support/data.hpp"

#include "legs/leg_config.hpp"
#include "recordings.hpp"

namespace geoflow::slam {
namespace {

const LegConfig& config() {
  static const LegConfig shared = [] {
    LegConfig made;
    made.T_base_imu = SE3{so3::exp({0.3, -0.2, 1.1}), Vector3d{0.1, 0, 0.05}};
    return made;
  }();
  return shared;
}

struct Source {
  std::mt19937_64 random;
  std::normal_distribution<double> normal;
  Vector3d vector(double sigma) {
    return sigma * Vector3d{normal(random), normal(random), normal(random)};
  }
};

constexpr double kStep = 0.002;
constexpr int kSteps = 100;
const Vector3d gyro_bias{0.01, -0.02, 0.015};  // of the gyroscope, in imu

/// Half of the velocities depend on the turn as one foot's does.
struct Motion {
  std::vector<Vector3d> gyro;      ///< in imu, with gyro_bias
  std::vector<Vector3d> velocity;  ///< in base, at gyro_bias
  Matrix3d by_turn = skew(Vector3d{0.2, 0.1, -0.3});
};

Motion random_motion(Source& source) {
  Motion motion;
  const Vector3d turn = source.vector(1);
  const Vector3d velocity = source.vector(0.5);
  for (int k = 0; k < kSteps; ++k) {
    motion.gyro.emplace_back(gyro_bias + turn + source.vector(0.1));
    motion.velocity.emplace_back(velocity + source.vector(0.05));
  }
  return motion;
}

LegIncrement integrate(const Motion& motion, const Vector3d& bias, const Vector3d& bias_velocity) {
  LegPreintegrator preintegrator{config()};
  preintegrator.begin(tests::at_seconds(0), bias);
  const Matrix3d R_base_imu = config().T_base_imu.rotation_matrix();
  for (std::size_t k = 0; k < motion.gyro.size(); ++k) {
    // A larger bias leaves less turn, which changes what a foot says of the velocity.
    const Vector3d v_base =
        motion.velocity[k] - bias_velocity - motion.by_turn * (R_base_imu * (bias - gyro_bias));
    preintegrator.add(
        {.dt_s = kStep,
         .gyro_radps = motion.gyro[k],
         .velocity = {.v_base_mps = v_base, .covariance = 1e-3 * Matrix3d::Identity()},
         .velocity_by_turn = motion.by_turn,
         .sample_s = kStep,
         .contact = k % 2 == 0});
  }
  return preintegrator.increment(tests::at_seconds(kStep * kSteps));
}

TEST(LegPreintegration, BiasDerivativesAreThoseOfIntegratingAnew) {
  Source source{.random = std::mt19937_64{tests::test_seed(41)}, .normal = {}};
  constexpr double kSmall = 1e-6;
  for (int trial = 0; trial < 20; ++trial) {
    const Motion motion = random_motion(source);
    const LegIncrement at_bias = integrate(motion, gyro_bias, Vector3d::Zero());
    EXPECT_DOUBLE_EQ(at_bias.contact, 0.5);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d small = kSmall * Vector3d::Unit(axis);
      const Vector3d by_gyro = (integrate(motion, gyro_bias + small, Vector3d::Zero()).dp -
                                integrate(motion, gyro_bias - small, Vector3d::Zero()).dp) /
                               (2 * kSmall);
      EXPECT_LT((by_gyro - at_bias.by_gyro_bias.col(axis)).norm(), 1e-7);
      const Vector3d by_velocity =
          (integrate(motion, gyro_bias, small).dp - integrate(motion, gyro_bias, -small).dp) /
          (2 * kSmall);
      EXPECT_LT((by_velocity - at_bias.by_velocity_bias.col(axis)).norm(), 1e-7);
    }
  }
}

TEST(LegPreintegration, ResidualsDerivativesAreThoseOfDifferences) {
  Source source{.random = std::mt19937_64{tests::test_seed(42)}, .normal = {}};
  const LegIncrement measured = integrate(random_motion(source), gyro_bias, Vector3d::Zero());
  const auto random_pose = [&] { return SE3{so3::exp(source.vector(1)), source.vector(2)}; };
  constexpr double kSmall = 1e-6;
  for (int trial = 0; trial < 20; ++trial) {
    const SE3 T_odom_base0 = random_pose();
    const SE3 T_odom_base1 = random_pose();
    const Vector3d bias = gyro_bias + source.vector(0.01);
    const Vector3d drift = source.vector(0.05);
    const LegResidual residual = leg_residual(measured, T_odom_base0, T_odom_base1, bias, drift);
    const auto slope = [&](const auto& residual_at) {
      return Vector3d{(residual_at(kSmall) - residual_at(-kSmall)) / (2 * kSmall)};
    };
    for (int axis = 0; axis < 6; ++axis) {
      const Vector6d unit = Vector6d::Unit(axis);
      const Vector3d by_first = slope([&](double h) {
        return leg_residual(measured, T_odom_base0 * SE3::exp(h * unit), T_odom_base1, bias, drift)
            .value;
      });
      EXPECT_LT((by_first - residual.by_first.col(axis)).norm(), 1e-7);
      const Vector3d by_second = slope([&](double h) {
        return leg_residual(measured, T_odom_base0, T_odom_base1 * SE3::exp(h * unit), bias, drift)
            .value;
      });
      EXPECT_LT((by_second - residual.by_second.col(axis)).norm(), 1e-7);
    }
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d unit = Vector3d::Unit(axis);
      const Vector3d by_gyro = slope([&](double h) {
        return leg_residual(measured, T_odom_base0, T_odom_base1, bias + h * unit, drift).value;
      });
      EXPECT_LT((by_gyro - residual.by_gyro_bias.col(axis)).norm(), 1e-7);
      const Vector3d by_drift = slope([&](double h) {
        return leg_residual(measured, T_odom_base0, T_odom_base1, bias, drift + h * unit).value;
      });
      EXPECT_LT((by_drift - residual.by_velocity_bias.col(axis)).norm(), 1e-7);
    }
  }
}

/// Noise of the gyroscope and of the velocity, drawn as the model says.
TEST(LegPreintegration, CovarianceIsConsistent) {
  Source source{.random = std::mt19937_64{tests::test_seed(43)}, .normal = {}};
  const Motion truth = random_motion(source);
  const LegIncrement exact = integrate(truth, gyro_bias, Vector3d::Zero());
  const double gyro_sigma = config().imu_noise.gyro_noise_density / std::sqrt(kStep);
  const LegNoise& noise = config().noise;
  constexpr int kTrials = 1000;
  double nees = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Motion noisy = truth;
    Vector3d lasting = Vector3d::Zero();
    for (int k = 0; k < kSteps; ++k) {
      const auto row = static_cast<std::size_t>(k);
      const int memory = static_cast<int>(noise.speed_memory_s / kStep);
      lasting = k % memory == 0 ? source.vector(noise.speed_mps) : lasting;
      noisy.gyro[row] += source.vector(gyro_sigma);
      noisy.velocity[row] += source.vector(std::sqrt(1e-3)) + lasting;
    }
    const LegIncrement measured = integrate(noisy, gyro_bias, Vector3d::Zero());
    const Vector3d error = measured.dp - exact.dp;
    nees += error.dot(measured.covariance.inverse() * error) / 3 / kTrials;
  }
  RecordProperty("nees_per_dof", std::to_string(nees));
  EXPECT_NEAR(nees, 1, 0.1);
}

}  // namespace
}  // namespace geoflow::slam
