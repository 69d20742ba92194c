#include <algorithm>
#include <chrono>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "legs/contact_filter.hpp"
#include "legs/leg_odometry.hpp"

namespace geoflow::slam {
namespace {

/// A robot that does not stand still within this is taken as moving.
constexpr Duration kPatience = std::chrono::seconds{2};
/// Then: a tilt by an acceleration of 1 m/s^2 over a second, and a trot's speed.
constexpr double kMovingTilt = 0.1;   // [rad]
constexpr double kMovingSpeed = 1.0;  // [m/s]
/// Of a robot that stands [m/s].
constexpr double kStartSpeed = 3e-3;

double square(double x) {
  return x * x;
}

}  // namespace

void LegOdometry::start(const StandingFix& fix) {
  const SE3 T_odom_imu = SE3{fix.R_odom_imu, Vector3d::Zero()};
  LeggedState state;
  state.q_odom_imu = fix.R_odom_imu;
  // base begins in odom's origin.
  state.p_odom = -(T_odom_imu * T_imu_base_.translation());
  state.bias_gyro = fix.bias.gyro_radps;
  state.bias_accel = fix.bias.accel_mps2;
  const Matrix3d R = fix.R_odom_imu.toRotationMatrix();
  using FromFix = Eigen::Matrix<double, ContactFilter::kErrorSize, kMotionSize>;
  FromFix J = FromFix::Zero();
  J.block<3, 3>(ContactFilter::kAttitude, 0) = R;
  // The origin is base's place, exactly: a tilt moves the IMU about it, which in this error is
  // delta_p = p x delta_R - p x delta_R = 0.
  J.block<6, 6>(ContactFilter::kGyroBias, 3).setIdentity();
  ContactFilter::Covariance P = J * fix.covariance * J.transpose();
  P.block<3, 3>(ContactFilter::kVelocity, ContactFilter::kVelocity) =
      square(kStartSpeed) * Matrix3d::Identity();
  filter_.reset(state, P);
  t_ = fix.t;
  started_ = true;
  contact_ = {};
  R_odom_calf_ = {};
  last_legs_.reset();
  t_last_twist_.reset();
  leg_step_ = {};
  preintegrator_.begin(t_, state.bias_gyro);
}

void LegOdometry::try_start(HostTime t) {
  if (const Result<StandingFix> fix = initialiser_.fix()) {
    start(*fix);
  } else if (!imu_.empty() && t_first_ && t - *t_first_ >= kPatience) {
    Vector3d sum = Vector3d::Zero();
    const HostTime t_end = std::min(t, imu_.newest());
    for (HostTime s = t_end - kPatience / 2; s < t_end; s = imu_.next_knot(s, t_end)) {
      sum += imu_.at(s).accel_mps2;
    }
    StandingFix guess;
    guess.t = t_end;
    guess.R_odom_imu = level_rotation(sum.normalized(), T_imu_base_.rotation() * Vector3d::UnitX());
    guess.bias = prior_.bias;
    const Vector3d up_imu = guess.R_odom_imu.conjugate() * Vector3d::UnitZ();
    guess.covariance.topLeftCorner<3, 3>() =
        square(kMovingTilt) * (Matrix3d::Identity() - up_imu * up_imu.transpose());
    guess.covariance.bottomRightCorner<6, 6>() = prior_.covariance;
    start(guess);
    filter_.widen_velocity(kMovingSpeed);
  }
  if (started_) {
    const auto past = [&](const auto& sample) { return sample.t <= t_; };
    std::erase_if(pending_, past);
    std::erase_if(pending_twists_, past);
  }
}

}  // namespace geoflow::slam
