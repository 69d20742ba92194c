#include "odometry/dead_reckoner.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"

#include "legs/leg_config.hpp"
#include "legs/leg_odometry.hpp"

namespace geoflow::slam {
namespace {

/// Of a robot's own odometry: standard deviation of its velocity, and of its scale.
constexpr double kTwistSigmaMps = 0.05;
constexpr double kTwistSigmaRadps = 0.1;
constexpr double kTwistScale = 0.03;

constexpr double kUnknownM = 1;  ///< of a way that is not known

double squared(double x) {
  return x * x;
}

}  // namespace

ReckonedMotion operator*(const ReckonedMotion& first, const ReckonedMotion& second) {
  const SE3& T_cam1_cam2 = second.T_cam0_cam1;  // frames: the second's first camera is cam1
  const SE3 T_cam0_cam2 = first.T_cam0_cam1 * T_cam1_cam2;
  const Matrix6d A = T_cam1_cam2.inverse().adjoint();
  return {.T_cam0_cam1 = T_cam0_cam2,  // frames: of both together, cam2 is the later one
          .covariance = A * first.covariance * A.transpose() + second.covariance,
          .legs = first.legs && second.legs,
          .gyro = first.gyro.then(second.gyro, T_cam1_cam2.rotation_matrix()),
          .up = second.up};
}

DeadReckoner::DeadReckoner(const Switches& switches, const Calibration& calibration)
    : switches_{switches},
      T_base_cam_{calibration.T_base_cam.value_or(SE3{})},
      gyro_density_{leg_config_of(calibration).gyro_density()},
      base_known_{calibration.T_base_cam.has_value()} {
  if (switches.imu && calibration.T_cam_imu) {
    R_cam_imu_ = calibration.T_cam_imu->rotation_matrix();
    odometry_.emplace(leg_config_of(calibration));
  }
}

std::optional<ReckonedMotion> DeadReckoner::add(const SyncedPacket& packet) {
  std::optional<ReckonedMotion> motion;
  if (odometry_) {
    motion = by_inertia(*odometry_, packet);
  }
  if ((!motion || !motion->legs) && switches_.legs && base_known_) {
    if (const auto twist = by_twist(packet)) {
      motion = twist;
    }
  }
  t_last_ = packet.t;
  return motion;
}

ReckonedMotion DeadReckoner::of_camera(const SE3& T_base0_base1, const Matrix6d& covariance,
                                       bool legs) const {
  const SE3 T_cam_base = T_base_cam_.inverse();
  const Matrix6d A = T_cam_base.adjoint();
  return {.T_cam0_cam1 = T_cam_base * T_base0_base1 * T_base_cam_,
          .covariance = A * covariance * A.transpose(),
          .legs = legs};
}

std::optional<ReckonedMotion> DeadReckoner::by_inertia(LegOdometry& odometry,
                                                       const SyncedPacket& packet) {
  const bool legs = switches_.legs && base_known_;
  const auto before = last_;
  MotionSamples samples{.imu = packet.imu, .legs = {}, .body_velocity = {}};
  if (legs) {
    samples.legs = packet.legs;
  }
  last_ = odometry.add(samples, packet.t);
  if (!before || !last_) {
    return std::nullopt;
  }
  const double dt = to_seconds(last_->t - before->t);
  const SE3 T_base0_base1 = before->T_start_base.inverse() * last_->T_start_base;
  // Where measurements contradict the prediction, all of it is to be believed less.
  const double doubt = std::max(1.0, last_->health.nis);
  const double turned = T_base0_base1.log().head<3>().norm();
  constexpr double kGyroScale = 0.01;  // a MEMS gyroscope's scale error
  const double rotation = squared(gyro_density_) * dt + squared(kGyroScale * turned);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>() = rotation * Matrix3d::Identity();
  if (legs && !packet.legs.empty()) {
    covariance.bottomRightCorner<3, 3>() = last_->velocity.covariance * (dt * dt);
  } else {
    // A velocity that nothing corrects is anything after a few steps.
    covariance.bottomRightCorner<3, 3>().diagonal().setConstant(squared(kUnknownM));
  }
  ReckonedMotion motion = of_camera(T_base0_base1, doubt * covariance, last_->health.contact_s > 0);
  const Matrix3d per_bias = -dt * R_cam_imu_;
  motion.gyro = {.duration_s = dt,
                 .per_bias = per_bias,
                 .taken_out = per_bias * before->bias.gyro_radps,
                 .bias = last_->bias.gyro_radps,
                 .bias_covariance = last_->gyro_bias_covariance};
  motion.up = last_->up.seen_from(R_cam_imu_);
  motion.up->variance *= doubt;
  return motion;
}

void DeadReckoner::see_gyro_bias(const Vector3d& bias_radps) {
  if (odometry_) {
    odometry_->see_gyro_bias(bias_radps);
  }
}

std::optional<ReckonedMotion> DeadReckoner::by_twist(const SyncedPacket& packet) const {
  if (packet.body_velocity.empty() || !t_last_) {
    return std::nullopt;
  }
  Vector6d twist = Vector6d::Zero();
  for (const Timed<BodyVelocitySample>& sample : packet.body_velocity) {
    twist.head<3>() += sample.sample.w_base_radps;
    twist.tail<3>() += sample.sample.v_base_mps;
  }
  const double dt = to_seconds(packet.t - *t_last_);
  const Vector6d moved = dt / static_cast<double>(packet.body_velocity.size()) * twist;
  if (!moved.allFinite()) {
    return std::nullopt;
  }
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>().diagonal().setConstant(
      squared(kTwistSigmaRadps * dt) + squared(kTwistScale) * moved.head<3>().squaredNorm());
  covariance.bottomRightCorner<3, 3>().diagonal().setConstant(
      squared(kTwistSigmaMps * dt) + squared(kTwistScale) * moved.tail<3>().squaredNorm());
  return of_camera(SE3::exp(moved), covariance, true);
}

}  // namespace geoflow::slam
