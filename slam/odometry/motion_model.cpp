#include "odometry/motion_model.hpp"

#include <algorithm>
#include <cmath>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {
namespace {

/// Standard deviations of acceleration of a camera carried by hand or by a trotting robot: half a
/// g, and what turns a head from rest to 1 rad/s in 50 ms.
constexpr double kAcceleration = 5.0;          // [m/s^2]
constexpr double kAngularAcceleration = 20.0;  // [rad/s^2]
constexpr double kMemory = 0.1;                // [s]
/// In this time the acceleration above moves the image further than Lucas-Kanade reaches: 0.4 rad,
/// or 0.1 m.
constexpr double kBlind = 0.2;      // [s]
constexpr double kShortest = 1e-3;  // [s]

}  // namespace

void MotionModel::update(HostTime t, const SE3& T_odom_cam, bool followed) {
  const double dt = to_seconds(t - t_);
  if (followed && dt > 0 && dt < kMemory * 2) {
    velocity_ = (T_odom_cam_.inverse() * T_odom_cam).log() / dt;
  } else {
    velocity_ *= std::exp(-std::max(0.0, dt) / kMemory);
  }
  t_ = t;
  t_followed_ = followed ? t : t_followed_;
  T_odom_cam_ = T_odom_cam;
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

bool MotionModel::blind(HostTime t) const {
  return to_seconds(t - t_followed_) > kBlind;
}

PosePrior MotionModel::predict(HostTime t) const {
  const double dt = std::max(kShortest, to_seconds(t - t_followed_));
  const double sigma_rotation = 0.5 * kAngularAcceleration * dt * dt;
  const double sigma_translation = 0.5 * kAcceleration * dt * dt;
  Vector6d sigma;
  sigma << Vector3d::Constant(sigma_rotation), Vector3d::Constant(sigma_translation);
  return {T_odom_cam_ * motion_over(t - t_), sigma.cwiseInverse().cwiseAbs2().asDiagonal()};
}

void MotionModel::move(const SE3& T_odom1_odom0) {
  T_odom_cam_ = T_odom1_odom0 * T_odom_cam_;
}

}  // namespace geoflow::slam
