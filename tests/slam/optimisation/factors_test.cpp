#include "optimisation/factors.hpp"

#include <array>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "tests/support/data.hpp"

#include "inertial/gyro_turn.hpp"
#include "slam/optimisation/jacobian_check.hpp"
#include "vision/camera_model.hpp"

namespace geoflow::slam {
namespace {

const CameraModel pinhole{
    CameraIntrinsics{.width = 640, .height = 480, .fx = 517, .fy = 516, .cx = 318, .cy = 255}};

SE3 random_pose(std::mt19937_64& random, double scale) {
  std::uniform_real_distribution<double> uniform{-scale, scale};
  Vector6d xi;
  for (double& value : xi) {
    value = uniform(random);
  }
  return SE3::exp(xi);
}

TEST(Factors, JacobiansMatchDifferences) {
  std::mt19937_64 random{tests::test_seed(3)};
  for (int trial = 0; trial < 20; ++trial) {
    const SE3 T_odom_cam = random_pose(random, 0.6);
    const SE3 T_odom_a = random_pose(random, 0.6);
    const Vector3d p_odom = T_odom_cam * Vector3d{0.3, -0.2, 1.5 + 0.1 * trial};
    const std::vector<double> point{p_odom.x(), p_odom.y(), p_odom.z()};
    expect_jacobians(ReprojectionFactor{pinhole, {300, 200}, 1.5}, {block_of(T_odom_cam), point});
    expect_jacobians(PointDepthFactor{1.7, 0.01}, {block_of(T_odom_cam), point});

    expect_jacobians(UprightFactor{Vector3d::Random().normalized(), Vector3d::UnitZ(), 0.01},
                     {block_of(T_odom_cam)});

    Matrix6d root = Matrix6d::Random() + 3 * Matrix6d::Identity();
    const SE3 T_a_b = random_pose(random, 0.6);
    const SE3 T_odom_b = T_odom_a * T_a_b * random_pose(random, 0.1);
    expect_jacobians(RelativePoseFactor{T_a_b, root.transpose() * root},
                     {block_of(T_odom_a), block_of(T_odom_b)});

    const std::vector<double> bias{0.01, -0.02, 0.03 * trial};
    const GyroTurn gyro{
        .duration_s = 1, .per_bias = Matrix3d::Random(), .taken_out = 0.02 * Vector3d::Random()};
    expect_jacobians(ReckonedFactor{T_a_b, root.transpose() * root, gyro},
                     {block_of(T_odom_a), block_of(T_odom_b), bias});
    expect_jacobians(BiasWalkFactor{0.003}, {bias, {0, 0.01, 0}});
    const Matrix3d spread = Matrix3d::Random() + 3 * Matrix3d::Identity();
    expect_jacobians(BiasPriorFactor{{0.01, 0, 0}, spread * spread.transpose()}, {bias});
  }
}

TEST(Factors, APriorOfABiasCountsItsErrorInStandardDeviations) {
  Matrix3d covariance = Matrix3d::Zero();
  covariance.diagonal() << 4e-6, 1e-6, 9e-6;
  const BiasPriorFactor factor{{0.01, 0, 0}, covariance};
  const Vector3d bias{0.012, -0.001, 0.003};
  const std::array<const double*, 1> parameters{bias.data()};
  Vector3d residuals;
  ASSERT_TRUE(factor.Evaluate(parameters.data(), residuals.data(), nullptr));
  EXPECT_NEAR(residuals.squaredNorm(), 3, 1e-9);
}

TEST(Factors, RelativePoseLeavesOpenDirectionsFree) {
  Matrix6d information = Matrix6d::Identity();
  information(5, 5) = 0;  // nothing is known along z
  const RelativePoseFactor factor{SE3{}, information};
  const auto a = block_of(SE3{});
  const auto b = block_of(SE3{Eigen::Quaterniond::Identity(), {0, 0, 5}});
  const std::array<const double*, 2> parameters{a.data(), b.data()};
  Vector6d residuals;
  ASSERT_TRUE(factor.Evaluate(parameters.data(), residuals.data(), nullptr));
  EXPECT_LT(residuals.norm(), 1e-12);
}

TEST(Factors, PointBehindTheCameraIsRefused) {
  const auto pose = block_of(SE3{});
  const std::vector<double> behind{0, 0, -1};
  const std::array<const double*, 2> parameters{pose.data(), behind.data()};
  Vector2d residuals;
  const ReprojectionFactor factor{pinhole, {0, 0}, 1};
  EXPECT_FALSE(factor.Evaluate(parameters.data(), residuals.data(), nullptr));
}

}  // namespace
}  // namespace geoflow::slam
