#include "odometry/motion_model.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "odometry/dead_reckoner.hpp"
#include "odometry/pose_optimiser.hpp"
#include "optimisation/matrix6.hpp"

namespace geoflow::slam {
namespace {

/// Standard deviations of acceleration of a camera carried by hand or by a trotting robot: half a
/// g, and what turns a head from rest to 1 rad/s in 50 ms.
constexpr double kAcceleration = 5.0;          // [m/s^2]
constexpr double kAngularAcceleration = 20.0;  // [rad/s^2]
constexpr double kMemory = 0.1;                // [s]
/// Standard deviations of a prediction beyond what Lucas-Kanade can make up for: where constant
/// velocity is after 0.2 s.
constexpr double kBlindRad = 0.4;
constexpr double kBlindM = 0.1;
constexpr double kShortest = 1e-3;  // [s]

}  // namespace

bool is_blind(const PosePrior& prior) {
  const Vector6d variance = inverse(prior.information).diagonal();
  return variance.head<3>().maxCoeff() > kBlindRad * kBlindRad ||
         variance.tail<3>().maxCoeff() > kBlindM * kBlindM;
}

void MotionModel::update(HostTime t, const SE3& T_odom_cam, const Matrix6d& covariance,
                         bool followed) {
  const double dt = to_seconds(t - t_);
  if (followed && dt > 0 && dt < kMemory * 2) {
    velocity_ = (T_odom_cam_.inverse() * T_odom_cam).log() / dt;
  } else {
    velocity_ *= std::exp(-std::max(0.0, dt) / kMemory);
  }
  t_ = t;
  t_followed_ = followed ? t : t_followed_;
  T_odom_cam_ = T_odom_cam;
  if (followed) {
    covariance_ = covariance;
  } else {
    covariance_.topLeftCorner<3, 3>() = covariance.topLeftCorner<3, 3>();
  }
}

SE3 MotionModel::motion_over(Duration duration) const {
  const double dt = to_seconds(duration);
  // The integral of a velocity that fades with the time constant kMemory beyond kMemory.
  const double travelled =
      std::abs(dt) <= kMemory
          ? dt
          : std::copysign(kMemory * (2 - std::exp(1 - std::abs(dt) / kMemory)), dt);
  return SE3::exp(travelled * velocity_);
}

PosePrior MotionModel::predict(HostTime t, const std::optional<ReckonedMotion>& motion) const {
  const double dt = std::max(kShortest, to_seconds(t - t_followed_));
  SE3 T_cam0_cam1 = motion_over(t - t_);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>().diagonal().setConstant(
      std::pow(0.5 * kAngularAcceleration * dt * dt, 2));
  covariance.bottomRightCorner<3, 3>().diagonal().setConstant(
      std::pow(0.5 * kAcceleration * dt * dt, 2));
  if (motion) {
    const bool knows_way = motion->covariance.bottomRightCorner<3, 3>().trace() <
                           covariance.bottomRightCorner<3, 3>().trace();
    if (knows_way) {
      T_cam0_cam1 = motion->T_cam0_cam1;
      covariance = motion->covariance;
    } else {
      T_cam0_cam1 = SE3{motion->T_cam0_cam1.rotation(), T_cam0_cam1.translation()};
      covariance.topLeftCorner<3, 3>() = motion->covariance.topLeftCorner<3, 3>();
    }
    const Matrix6d A = T_cam0_cam1.inverse().adjoint();
    covariance += A * covariance_ * A.transpose();
  }
  const SE3& T_odom_cam0 = T_odom_cam_;
  return {.T_odom_cam = T_odom_cam0 * T_cam0_cam1, .information = covariance.inverse()};
}

void MotionModel::move(const SE3& T_odom1_odom0) {
  T_odom_cam_ = T_odom1_odom0 * T_odom_cam_;
}

}  // namespace geoflow::slam
