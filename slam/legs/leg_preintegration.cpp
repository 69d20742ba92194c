#include "legs/leg_preintegration.hpp"

#include <algorithm>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "legs/leg_config.hpp"

namespace geoflow::slam {

LegResidual leg_residual(const LegIncrement& measured, const SE3& T_odom_base0,
                         const SE3& T_odom_base1, const Vector3d& bias_gyro,
                         const Vector3d& bias_velocity) {
  const SE3 T_base0_base1 = T_odom_base0.inverse() * T_odom_base1;
  const Vector3d& moved = T_base0_base1.translation();
  LegResidual residual;
  residual.value = moved - measured.dp - measured.by_gyro_bias * (bias_gyro - measured.bias_gyro) -
                   measured.by_velocity_bias * bias_velocity;
  residual.by_first << skew(moved), -Matrix3d::Identity();
  residual.by_second.rightCols<3>() = T_base0_base1.rotation_matrix();
  residual.by_gyro_bias = -measured.by_gyro_bias;
  residual.by_velocity_bias = -measured.by_velocity_bias;
  return residual;
}

LegPreintegrator::LegPreintegrator(const LegConfig& config)
    : R_base_imu_{config.T_base_imu.rotation_matrix()},
      noise_{config.noise},
      gyro_density_{config.imu_noise.gyro_noise_density} {}

void LegPreintegrator::begin(HostTime t, const Vector3d& bias_gyro) {
  sum_ = {};
  sum_.t_begin = t;
  sum_.bias_gyro = bias_gyro;
  q_base0_base_.setIdentity();
  covariance_.setZero();
  rotation_by_bias_.setZero();
  dp_by_bias_.setZero();
  duration_s_ = 0;
  contact_s_ = 0;
}

void LegPreintegrator::add(const LegStep& step) {
  const double dt = step.dt_s;
  const Vector3d turn = R_base_imu_ * (step.gyro_radps - sum_.bias_gyro) * dt;
  const Vector3d& v = step.velocity.v_base_mps;
  // The velocity holds in the middle of the turn.
  const Matrix3d R_middle = (q_base0_base_ * so3::exp(0.5 * turn)).toRotationMatrix();
  const Matrix3d R_step = so3::exp(turn).toRotationMatrix();
  const Matrix3d J_half = 0.5 * dt * so3::right_jacobian(0.5 * turn);
  const Matrix3d J_turn = dt * so3::right_jacobian(turn);
  const Matrix3d R_half = so3::exp(0.5 * turn).toRotationMatrix();

  sum_.dp += R_middle * v * dt;
  sum_.by_velocity_bias -= R_middle * dt;
  // A larger bias turns less: w = measured - bias.
  const Matrix3d middle_by_bias = R_half.transpose() * rotation_by_bias_ - J_half;
  dp_by_bias_ -= R_middle * (skew(v) * middle_by_bias + step.velocity_by_turn) * dt;
  rotation_by_bias_ = R_step.transpose() * rotation_by_bias_ - J_turn;

  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = R_step.transpose();
  F.bottomLeftCorner<3, 3>() = -R_middle * skew(v) * R_half.transpose() * dt;
  covariance_ = (F * covariance_ * F.transpose()).eval();
  covariance_.topLeftCorner<3, 3>() += gyro_density_ * gyro_density_ * dt * Matrix3d::Identity();
  covariance_.bottomRightCorner<3, 3>() += R_middle * step.velocity.covariance *
                                           R_middle.transpose() *
                                           (dt * std::max(dt, step.sample_s));
  q_base0_base_ = (q_base0_base_ * so3::exp(turn)).normalized();
  duration_s_ += dt;
  contact_s_ += step.contact ? dt : 0;
}

LegIncrement LegPreintegrator::increment(HostTime t_end) const {
  LegIncrement result = sum_;
  result.t_end = t_end;
  result.by_gyro_bias = dp_by_bias_ * R_base_imu_;
  // Beyond its memory, the velocity's lasting error is drawn anew.
  const double lasting = noise_.speed_mps * noise_.speed_mps * duration_s_ *
                         std::min(duration_s_, noise_.speed_memory_s);
  result.covariance = covariance_.bottomRightCorner<3, 3>() + lasting * Matrix3d::Identity();
  result.contact = duration_s_ > 0 ? contact_s_ / duration_s_ : 0.0;
  return result;
}

}  // namespace geoflow::slam
