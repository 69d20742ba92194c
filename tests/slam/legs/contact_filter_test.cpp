#include "legs/contact_filter.hpp"

#include <cstddef>
#include <limits>
#include <random>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "tests/support/data.hpp"

#include "inertial/up_direction.hpp"

namespace geoflow::slam {
namespace {

using Error = Eigen::Matrix<double, ContactFilter::kErrorSize, 1>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Vector3d random_vector(std::mt19937_64& random, double scale) {
  std::uniform_real_distribution<double> uniform{-scale, scale};
  return {uniform(random), uniform(random), uniform(random)};
}

LeggedState random_state(std::mt19937_64& random) {
  LeggedState state;
  state.q_odom_imu = so3::exp(random_vector(random, 1.5));
  state.v_odom = random_vector(random, 1);
  state.p_odom = random_vector(random, 5);
  state.bias_gyro = random_vector(random, 0.02);
  state.bias_accel = random_vector(random, 0.2);
  for (Vector3d& foothold : state.footholds) {
    foothold = state.p_odom + random_vector(random, 0.4);
  }
  return state;
}

/// The state whose error is `delta`, by the definition in the header.
LeggedState moved(const LeggedState& state, const Error& delta) {
  const Eigen::Quaterniond rotation = so3::exp(delta.segment<3>(ContactFilter::kAttitude));
  LeggedState result = state;
  result.q_odom_imu = rotation * state.q_odom_imu;
  result.v_odom = rotation * state.v_odom + delta.segment<3>(ContactFilter::kVelocity);
  result.p_odom = rotation * state.p_odom + delta.segment<3>(ContactFilter::kPosition);
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const int block = ContactFilter::kFoothold + 3 * static_cast<int>(leg);
    result.footholds.at(leg) = rotation * state.footholds.at(leg) + delta.segment<3>(block);
  }
  result.bias_gyro += delta.segment<3>(ContactFilter::kGyroBias);
  result.bias_accel += delta.segment<3>(ContactFilter::kAccelBias);
  return result;
}

/// The error by which `truth` differs from `state`, to first order in its rotation.
Error error_of(const LeggedState& truth, const LeggedState& state) {
  const Eigen::Quaterniond rotation = truth.q_odom_imu * state.q_odom_imu.conjugate();
  Error delta;
  delta.segment<3>(ContactFilter::kAttitude) = so3::log(rotation);
  delta.segment<3>(ContactFilter::kVelocity) = truth.v_odom - rotation * state.v_odom;
  delta.segment<3>(ContactFilter::kPosition) = truth.p_odom - rotation * state.p_odom;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    delta.segment<3>(ContactFilter::kFoothold + 3 * static_cast<int>(leg)) =
        truth.footholds.at(leg) - rotation * state.footholds.at(leg);
  }
  delta.segment<3>(ContactFilter::kGyroBias) = truth.bias_gyro - state.bias_gyro;
  delta.segment<3>(ContactFilter::kAccelBias) = truth.bias_accel - state.bias_accel;
  const Eigen::Quaterniond begin = truth.q_odom_begin * state.q_odom_begin.conjugate();
  delta.segment<3>(ContactFilter::kBeginAttitude) = so3::log(begin);
  delta.segment<3>(ContactFilter::kBeginPosition) = truth.p_odom_begin - begin * state.p_odom_begin;
  return delta;
}

/// What is known of the tilt if the accelerometer's bias is known, and how it follows from that.
TEST(ContactFilter, UpIsToldWithWhatTheAccelerometersBiasDoesToIt) {
  constexpr double kSigmaRad = 0.002;
  std::mt19937_64 random{tests::test_seed(8)};
  const LeggedState state = random_state(random);
  const Matrix3d attitude_per_bias = 0.1 * Matrix3d::Random();
  const Matrix3d of_bias = Vector3d{0.04, 0.01, 0.02}.asDiagonal();
  ContactFilter::Covariance covariance = 1e-6 * ContactFilter::Covariance::Identity();
  constexpr int kAttitude = ContactFilter::kAttitude;
  constexpr int kBias = ContactFilter::kAccelBias;
  covariance.block<3, 3>(kBias, kBias) = of_bias;
  covariance.block<3, 3>(kAttitude, kBias) = attitude_per_bias * of_bias;
  covariance.block<3, 3>(kBias, kAttitude) = of_bias * attitude_per_bias.transpose();
  covariance.block<3, 3>(kAttitude, kAttitude) =
      attitude_per_bias * of_bias * attitude_per_bias.transpose() +
      kSigmaRad * kSigmaRad * Matrix3d::Identity();
  ContactFilter filter;
  filter.reset(state, covariance);
  const UpDirection up = filter.up();
  EXPECT_NEAR((state.q_odom_imu * up.up - Vector3d::UnitZ()).norm(), 0, 1e-12);
  EXPECT_NEAR(up.variance, kSigmaRad * kSigmaRad, 1e-9);
  EXPECT_EQ(up.bias, state.bias_accel);

  const Vector3d bias_error{1e-3, -2e-3, 1e-3};
  Error delta = Error::Zero();
  delta.segment<3>(kBias) = bias_error;
  delta.segment<3>(kAttitude) = attitude_per_bias * bias_error;
  const LeggedState truth = moved(state, delta);
  const Vector3d up_imu = truth.q_odom_imu.conjugate() * Vector3d::UnitZ();
  EXPECT_NEAR((up.given(truth.bias_accel) - up_imu).norm(), 0, 1e-6);
  EXPECT_GT((up.up - up_imu).norm(), 1e-5);
}

/// A covariance of rank one carries an error through the filter's own linearisation: it must be
/// the error that the non-linear propagation has.
TEST(ContactFilter, CovarianceFollowsTheMotion) {
  std::mt19937_64 random{tests::test_seed(11)};
  constexpr double kSmall = 1e-5;
  constexpr double kDt = 0.005;
  for (int trial = 0; trial < 50; ++trial) {
    const LeggedState state = random_state(random);
    const ImuSample imu{.accel_mps2 = random_vector(random, 12),
                        .gyro_radps = random_vector(random, 2)};
    for (int axis = 0; axis < ContactFilter::kBeginAttitude; ++axis) {
      const Error delta = kSmall * Error::Unit(axis);
      ContactFilter filter;
      filter.reset(state, delta * delta.transpose());
      filter.propagate(imu, kDt, {});
      ContactFilter truth;
      truth.reset(moved(state, delta), ContactFilter::Covariance::Zero());
      truth.propagate(imu, kDt, {});
      const Error expected = error_of(truth.state(), filter.state());
      const ContactFilter::Covariance difference =
          filter.covariance() - expected * expected.transpose();
      // Left over: terms of third order in dt.
      EXPECT_LT(difference.cwiseAbs().maxCoeff(), 2e-4 * kSmall * kSmall) << "axis " << axis;
    }
  }
}

TEST(ContactFilter, PoseAndVelocityCovarianceAreOfRightPerturbations) {
  std::mt19937_64 random{tests::test_seed(12)};
  constexpr double kSmall = 1e-6;
  const LeggedState state = random_state(random);
  for (int axis = 0; axis < 9; ++axis) {
    const Error delta = kSmall * Error::Unit(axis);
    ContactFilter filter;
    filter.reset(state, delta * delta.transpose());
    const LeggedState truth = moved(state, delta);
    const SE3 T_odom_estimate{state.q_odom_imu, state.p_odom};
    const SE3 T_odom_truth{truth.q_odom_imu, truth.p_odom};
    const Vector6d xi = (T_odom_estimate.inverse() * T_odom_truth).log();
    const Vector3d dv = truth.v_odom - state.v_odom;
    EXPECT_LT((filter.pose_covariance() - xi * xi.transpose()).norm(), 1e-4 * kSmall * kSmall);
    EXPECT_LT((filter.velocity_covariance() - dv * dv.transpose()).norm(), 1e-4 * kSmall * kSmall);
  }
}

TEST(ContactFilter, AKnownFootholdCorrectsThePosition) {
  std::mt19937_64 random{tests::test_seed(13)};
  const LeggedState state = random_state(random);
  ContactFilter filter;
  filter.reset(state, 1e-4 * ContactFilter::Covariance::Identity());
  const SE3 T_odom_imu{state.q_odom_imu, state.p_odom};
  const Vector3d foot_in_imu{0.2, 0.1, -0.3};
  filter.touch_down(Leg::kFrontLeft, foot_in_imu, 1e-10 * Matrix3d::Identity());
  EXPECT_LT((filter.state().footholds[1] - T_odom_imu * foot_in_imu).norm(), 1e-12);
  // The foot is seen a centimetre farther back: the body has moved ahead by that much, because the
  // foothold is tied to the old position as tightly as the new one is not.
  ContactFilter::StepNoise noise;
  noise.accel = 10;
  filter.propagate(
      {.accel_mps2 = state.bias_accel + state.q_odom_imu.conjugate() * Vector3d{0, 0, 9.80665},
       .gyro_radps = state.bias_gyro},
      1e-2, noise);
  const Vector3d before = filter.state().p_odom;
  const Vector3d back{-0.01, 0, 0};
  const double nis = filter.update_foothold(Leg::kFrontLeft, foot_in_imu + back,
                                            1e-10 * Matrix3d::Identity(), kInfinity);
  EXPECT_GT(nis, 0);
  const Vector3d foot_now =
      SE3{filter.state().q_odom_imu, filter.state().p_odom} * (foot_in_imu + back);
  EXPECT_LT((foot_now - filter.state().footholds[1]).norm(), 1e-4);
  EXPECT_GT((filter.state().p_odom - before).norm(), 1e-3);
}

/// The specific force of a robot at rest tells its tilt by and by: all poses turn by that, and the
/// way between them stays as it was.
TEST(ContactFilter, WhatIsLearntOfTheTiltIsNoMotion) {
  constexpr double kTilt = 0.03;
  const Vector3d at_rest{0, 0, 9.80665};
  LeggedState state;
  state.q_odom_imu = so3::exp({kTilt, 0, 0});
  ContactFilter::Covariance P = 1e-8 * ContactFilter::Covariance::Identity();
  P.block<3, 3>(ContactFilter::kAttitude, ContactFilter::kAttitude) = 1e-3 * Matrix3d::Identity();
  ContactFilter filter;
  filter.reset(state, P);
  constexpr double kStep = 5e-3;
  for (int step = 0; step < 200; ++step) {
    filter.propagate({.accel_mps2 = at_rest, .gyro_radps = Vector3d::Zero()}, kStep,
                     {.gyro = 1e-4, .accel = 1e-2});
    filter.update_velocity(Vector3d::Zero(), 1e-6 * Matrix3d::Identity(), kInfinity);
  }
  EXPECT_LT(so3::log(filter.state().q_odom_imu).norm(), kTilt / 20);
  EXPECT_LT(so3::log(filter.way().rotation()).norm(), kTilt / 100);
  EXPECT_LT(filter.way().translation().norm(), 1e-3);
}

TEST(ContactFilter, RefusesWhatContradictsItAndNotANumber) {
  ContactFilter filter;
  filter.reset({}, 1e-4 * ContactFilter::Covariance::Identity());
  const ContactFilter::Covariance before = filter.covariance();
  EXPECT_GT(filter.update_velocity({5, 0, 0}, 1e-4 * Matrix3d::Identity(), 16.3), 16.3);
  filter.update_velocity(Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()),
                         Matrix3d::Identity(), 16.3);
  EXPECT_EQ(filter.covariance(), before);
  EXPECT_EQ(filter.state().v_odom, Vector3d::Zero());
}

}  // namespace
}  // namespace geoflow::slam
