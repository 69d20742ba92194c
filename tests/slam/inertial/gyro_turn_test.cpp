#include "inertial/gyro_turn.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {
namespace {

constexpr double kStepS = 0.005;
constexpr int kStepsEach = 200;  // of two motions

/// A turning camera's gyroscope [rad/s], imu frame, with its bias.
Vector3d gyro_at(double t_s) {
  return {0.4 * std::sin(3 * t_s), 0.6, -0.3 * std::cos(5 * t_s)};
}

/// The rotation of one motion as a reckoner makes it that takes this bias for the gyroscope's.
Matrix3d integrate(int first_step, const Vector3d& bias, const Matrix3d& R_cam_imu,
                   GyroTurn* gyro = nullptr) {
  Matrix3d R_cam0_cam = Matrix3d::Identity();
  for (int i = first_step; i < first_step + kStepsEach; ++i) {
    const Matrix3d R_step =
        so3::exp(kStepS * (R_cam_imu * (gyro_at(i * kStepS) - bias))).toRotationMatrix();
    R_cam0_cam = R_cam0_cam * R_step;
    if (gyro != nullptr) {
      const Matrix3d per_bias = -kStepS * R_cam_imu;
      const GyroTurn step{.duration_s = kStepS,
                          .per_bias = per_bias,
                          .taken_out = per_bias * bias,
                          .bias = bias,
                          .bias_covariance = Matrix3d::Identity()};
      *gyro = gyro->duration_s > 0 ? gyro->then(step, R_step) : step;
    }
  }
  return R_cam0_cam;
}

TEST(GyroTurn, MakesTheRotationThatAnotherBiasWouldHaveGiven) {
  const Matrix3d R_cam_imu = so3::exp({0.1, -0.2, 0.7}).toRotationMatrix();
  const Vector3d early{0.01, -0.02, 0.005};
  const Vector3d late{0.012, -0.018, 0.002};
  const Vector3d truth{0.003, -0.01, 0.008};
  GyroTurn first;
  GyroTurn second;
  const Matrix3d R_cam1_cam2 = integrate(kStepsEach, late, R_cam_imu, &second);
  const Matrix3d R_cam0_cam2 = integrate(0, early, R_cam_imu, &first) * R_cam1_cam2;
  const GyroTurn both = first.then(second, R_cam1_cam2);
  EXPECT_NEAR(both.duration_s, 2 * kStepsEach * kStepS, 1e-9);
  EXPECT_EQ(both.bias, late);
  const Matrix3d R_true = integrate(0, truth, R_cam_imu) * integrate(kStepsEach, truth, R_cam_imu);
  const auto error = [&](const Matrix3d& R) {
    return so3::log(Eigen::Quaterniond{R.transpose() * R_true}).norm();
  };
  EXPECT_GT(error(R_cam0_cam2), 0.01);
  // What is left is of second order in a turn of 25 mrad.
  EXPECT_LT(error(R_cam0_cam2 * so3::exp(both.correction(truth)).toRotationMatrix()), 3e-4);
}

TEST(GyroTurn, WhereNoGyroscopeWasHeardOnAPartOfTheWayNothingIsKnownOfTheWhole) {
  const GyroTurn heard{.duration_s = 1, .per_bias = Matrix3d::Identity()};
  const GyroTurn whole = heard.then({}, Matrix3d::Identity());
  EXPECT_EQ(whole.duration_s, 0);
  EXPECT_EQ(whole.correction({1, 2, 3}), Vector3d::Zero());
}

}  // namespace
}  // namespace geoflow::slam
