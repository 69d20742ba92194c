#include "legs/leg_odometry.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "legs/contact.hpp"
#include "legs/contact_filter.hpp"
#include "legs/foot_motion.hpp"
#include "legs/leg_config.hpp"
#include "legs/stance_velocity.hpp"

namespace geoflow::slam {
namespace {

/// A robot that does not stand still within this is taken as moving.
constexpr Duration kPatience = std::chrono::seconds{2};
/// Then: a tilt by an acceleration of 1 m/s^2 over a second, and a trot's speed.
constexpr double kMovingTilt = 0.1;   // [rad]
constexpr double kMovingSpeed = 1.0;  // [m/s]
/// Of a normalised innovation squared with 3 degrees of freedom: 99.9 %.
constexpr double kGate = 16.3;
/// How long a foot that is seen to move goes on moving [s]: with its speed it says how far.
constexpr double kDragMemory = 0.02;
/// Zero velocity is measured this often, not at each sample: its error is the robot's sway.
constexpr Duration kRestInterval = std::chrono::milliseconds{100};
constexpr double kRestSpeed = 3e-3;  // [m/s]
/// Least error of a mean gyroscope at rest: a robot's slow sway [rad/s].
constexpr double kRestTurn = 3e-4;

double square(double x) {
  return x * x;
}

bool same_joints(const LegSample& a, const LegSample& b) {
  return std::ranges::equal(a.joints, b.joints, [](const JointState& x, const JointState& y) {
    return x.q_rad == y.q_rad && x.dq_radps == y.dq_radps && x.tau_nm == y.tau_nm;
  });
}

}  // namespace

LegOdometry::LegOdometry(const LegConfig& config, const BiasPrior& bias)
    : config_{config},
      T_imu_base_{config.T_base_imu.inverse()},
      prior_{bias},
      initialiser_{config.imu_noise, bias, T_imu_base_.rotation() * Vector3d::UnitX()},
      stillness_{config.imu_noise},
      stance_estimator_{config.noise} {
  step_noise_.gyro = config.imu_noise.gyro_noise_density;
  step_noise_.accel = std::hypot(config.imu_noise.accel_noise_density, config.shock_density);
  step_noise_.gyro_walk = config.imu_noise.gyro_random_walk;
  step_noise_.accel_walk = config.imu_noise.accel_random_walk;
}

void LegOdometry::start(const StandingFix& fix) {
  const SE3 T_odom_imu = SE3{fix.R_odom_imu, Vector3d::Zero()};
  LeggedState state;
  state.q_odom_imu = fix.R_odom_imu;
  // base begins in odom's origin.
  state.p_odom = -(T_odom_imu * T_imu_base_.translation());
  state.bias_gyro = fix.bias.gyro_radps;
  state.bias_accel = fix.bias.accel_mps2;
  const Matrix3d R = fix.R_odom_imu.toRotationMatrix();
  Eigen::Matrix<double, ContactFilter::kErrorSize, 9> J =
      Eigen::Matrix<double, ContactFilter::kErrorSize, 9>::Zero();
  J.block<3, 3>(ContactFilter::kAttitude, 0) = R;
  // The origin is base's place, exactly: a tilt moves the IMU about it, which in this error is
  // delta_p = p x delta_R - p x delta_R = 0.
  J.block<6, 6>(ContactFilter::kGyroBias, 3).setIdentity();
  ContactFilter::Covariance P = J * fix.covariance * J.transpose();
  P.block<3, 3>(ContactFilter::kVelocity, ContactFilter::kVelocity) =
      square(kRestSpeed) * Matrix3d::Identity();
  filter_.reset(state, P);
  t_ = fix.t;
  started_ = true;
  contact_ = {};
  R_odom_calf_ = {};
  last_legs_.reset();
}

void LegOdometry::try_start(HostTime t) {
  if (const Result<StandingFix> fix = initialiser_.fix()) {
    start(*fix);
  } else if (!imu_.empty() && t - *t_first_ >= kPatience) {
    Vector3d sum = Vector3d::Zero();
    const HostTime t_end = std::min(t, imu_.newest());
    for (HostTime s = t_end - kPatience / 2; s < t_end; s = imu_.next_knot(s, t_end)) {
      sum += imu_.at(s).accel_mps2;
    }
    StandingFix guess;
    guess.t = t_end;
    guess.R_odom_imu = level_rotation(sum.normalized(), T_imu_base_.rotation() * Vector3d::UnitX());
    guess.bias = prior_.bias;
    const Matrix3d Rt = guess.R_odom_imu.toRotationMatrix().transpose();
    guess.covariance.topLeftCorner<3, 3>() =
        square(kMovingTilt) * (Matrix3d::Identity() - Rt.col(2) * Rt.col(2).transpose());
    guess.covariance.bottomRightCorner<6, 6>() = prior_.covariance;
    start(guess);
    filter_.widen_velocity(kMovingSpeed);
  }
  if (started_) {
    std::erase_if(pending_, [&](const Timed<LegSample>& legs) { return legs.t <= t_; });
  }
}

std::optional<LegEstimate> LegOdometry::add(std::span<const Timed<ImuSample>> imu,
                                            std::span<const Timed<LegSample>> legs, HostTime t) {
  for (const Timed<ImuSample>& sample : imu) {
    if (imu_.empty() || sample.t > imu_.newest()) {
      t_first_ = t_first_.value_or(sample.t);
      imu_.add(sample);
      if (!started_) {
        initialiser_.add(sample.t, sample.sample);
      }
    }
  }
  for (const Timed<LegSample>& sample : legs) {
    if (!t_newest_legs_ || sample.t > *t_newest_legs_) {
      t_newest_legs_ = sample.t;
      pending_.push_back(sample);
    }
  }
  if (!started_) {
    try_start(t);
  }
  if (!started_ || t < t_) {
    return std::nullopt;
  }
  health_ = {};
  while (!pending_.empty() && pending_.front().t <= t) {
    take(pending_.front());
    pending_.pop_front();
  }
  advance(t);
  imu_.forget_before(t);
  return estimate(t);
}

void LegOdometry::advance(HostTime t) {
  while (t_ < t) {
    const HostTime t_next = imu_.next_knot(t_, t);
    const double dt = to_seconds(t_next - t_);
    const ImuSample a = imu_.at(t_);
    const ImuSample b = imu_.at(t_next);
    filter_.propagate({.accel_mps2 = 0.5 * (a.accel_mps2 + b.accel_mps2),
                       .gyro_radps = 0.5 * (a.gyro_radps + b.gyro_radps)},
                      dt, step_noise_);
    stillness_.add(t_next, b);
    t_ = t_next;
  }
}

Matrix3d LegOdometry::R_odom_base() const {
  return (filter_.state().q_odom_imu * T_imu_base_.rotation()).toRotationMatrix();
}

BaseTurn LegOdometry::turn_at(HostTime t) const {
  const Matrix3d R_base_imu = config_.T_base_imu.rotation_matrix();
  const ImuNoise& noise = config_.imu_noise;
  return {.w_base_radps = R_base_imu * (imu_.at(t).gyro_radps - filter_.state().bias_gyro),
          .sigma_radps = noise.gyro_noise_density * std::sqrt(noise.rate_hz),
          .up_base = R_odom_base().transpose().col(2)};
}

VelocityBelief LegOdometry::base_velocity(const BaseTurn& turn) const {
  const Matrix3d R_base_odom = R_odom_base().transpose();
  const Vector3d p_base_imu = config_.T_base_imu.translation();
  const Matrix3d by_turn = turn.sigma_radps * skew(p_base_imu);
  return {.v_base_mps = R_base_odom * filter_.state().v_odom - turn.w_base_radps.cross(p_base_imu),
          .covariance = R_base_odom * filter_.velocity_covariance() * R_base_odom.transpose() +
                        by_turn * by_turn.transpose()};
}

FootMotions LegOdometry::motions(const LegSample& legs, const BaseTurn& turn) const {
  FootMotions motions;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const LegJoints joints = joints_of(legs, static_cast<Leg>(leg));
    if (legs.valid.at(leg) && joints.q_rad.allFinite() && joints.dq_radps.allFinite()) {
      motions.at(leg) = foot_motion(config_, static_cast<Leg>(leg), joints, turn);
    }
  }
  return motions;
}

std::array<std::optional<FootEvidence>, kLegCount> LegOdometry::evidence(const LegSample& legs,
                                                                         const FootMotions& motions,
                                                                         const BaseTurn& turn) {
  torques_seen_ = torques_seen_ || std::ranges::any_of(legs.joints, [](const JointState& joint) {
                    return joint.tau_nm != 0;
                  });
  const VelocityBelief body = base_velocity(turn);
  const Matrix3d R = R_odom_base();
  double lowest = std::numeric_limits<double>::infinity();
  for (const std::optional<FootMotion>& motion : motions) {
    lowest = motion ? std::min(lowest, turn.up_base.dot(motion->contact.point)) : lowest;
  }
  std::array<std::optional<FootEvidence>, kLegCount> evidence;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!motions.at(leg)) {
      continue;
    }
    const FootMotion& motion = *motions.at(leg);
    FootEvidence& foot = evidence.at(leg).emplace();
    foot.force = static_cast<double>(legs.foot_force.at(leg));
    foot.height_m = turn.up_base.dot(motion.contact.point) - lowest;
    // The point moves over ground by what the body does beyond what a standing foot would have it
    // do.
    foot.v_odom_mps = R * (body.v_base_mps - motion.v_base);
    foot.v_covariance = R * (body.covariance + motion.v_covariance) * R.transpose();
    if (torques_seen_) {
      const LegJoints joints = joints_of(legs, static_cast<Leg>(leg));
      const std::optional<Vector3d> force = ground_force(motion.contact.jacobian, joints.tau_nm);
      if (force && force->allFinite()) {
        foot.support_n = turn.up_base.dot(*force);
      }
    }
  }
  return evidence;
}

void LegOdometry::take(const Timed<LegSample>& legs) {
  if (legs.t < t_) {
    return;
  }
  advance(legs.t);
  stillness_.add(legs.t, legs.sample);
  if (last_legs_ && same_joints(legs.sample, last_legs_->sample)) {
    ++health_.duplicates;
    rest(legs.t);
    return;
  }
  const double dt = last_legs_ ? to_seconds(legs.t - last_legs_->t) : 0.0;
  last_legs_ = legs;
  const BaseTurn turn = turn_at(legs.t);
  const FootMotions found = motions(legs.sample, turn);
  const auto seen = evidence(legs.sample, found, turn);
  contact_.update(seen, dt);
  stance_ = stance_estimator_.update(found, contact_.feet(), base_velocity(turn));
  if (stance_.legs > 0) {
    health_.contact_s += dt;
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    double drag = 0;
    if (seen.at(leg)) {
      drag = std::max(
          0.0, seen.at(leg)->v_odom_mps.norm() - std::sqrt(seen.at(leg)->v_covariance.trace()));
    }
    const double dragged = drag * drag * kDragMemory;
    step_noise_.foothold.at(leg) =
        (config_.noise.creep_after(contact_.feet().at(leg).stance_s).cwiseAbs2() +
         Vector3d::Constant(dragged))
            .cwiseSqrt();
  }
  update_feet(found);
  rest(legs.t);
}

void LegOdometry::update_feet(const FootMotions& motions) {
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!contact_.feet().at(leg).stands) {
      R_odom_calf_.at(leg).reset();
    } else if (motions.at(leg)) {
      update_foot(static_cast<Leg>(leg), *motions.at(leg));
    }
  }
}

void LegOdometry::update_foot(Leg leg, const FootMotion& motion) {
  const Matrix3d R_imu_base = T_imu_base_.rotation_matrix();
  const Vector3d foot_in_imu = T_imu_base_ * motion.centre;
  const Matrix3d covariance = R_imu_base * motion.centre_covariance * R_imu_base.transpose();
  std::optional<Matrix3d>& R_odom_calf = R_odom_calf_.at(static_cast<std::size_t>(leg));
  const Matrix3d R_now = R_odom_base() * motion.R_base_calf;
  bool known = R_odom_calf.has_value();
  if (known) {
    const double radius = config_.rolling * config_.geometry.foot_radius_m;
    const Vector3d turned = so3::log(Eigen::Quaterniond{R_now * R_odom_calf->transpose()});
    filter_.roll(leg, turned.cross(radius * Vector3d::UnitZ()));
    const double nis = filter_.update_foothold(leg, foot_in_imu, covariance, kGate);
    count(nis);
    known = nis <= kGate;
  }
  if (!known) {
    filter_.touch_down(leg, foot_in_imu, covariance);
  }
  R_odom_calf = R_odom_base() * motion.R_base_calf;
}

void LegOdometry::count(double nis) {
  constexpr double kDegrees = 3;
  if (nis <= kGate) {
    ++health_.updates;
    health_.nis += (nis / kDegrees - health_.nis) / health_.updates;
  } else {
    ++health_.refused;
  }
}

void LegOdometry::rest(HostTime t) {
  const std::optional<StillInterval> interval = stillness_.still(filter_.state().bias_gyro);
  still_ = interval.has_value();
  if (!still_ || (t_rest_ && t - *t_rest_ < kRestInterval)) {
    return;
  }
  t_rest_ = t;
  count(
      filter_.update_velocity(Vector3d::Zero(), square(kRestSpeed) * Matrix3d::Identity(), kGate));
  // The window is averaged anew each time: its noise counts as often as windows overlap.
  const double overlap = to_seconds(interval->duration) / to_seconds(kRestInterval);
  const double variance =
      square(config_.imu_noise.gyro_noise_density) / to_seconds(interval->duration) +
      square(kRestTurn);
  filter_.update_gyro_bias(interval->gyro_radps, overlap * variance * Matrix3d::Identity());
}

LegEstimate LegOdometry::estimate(HostTime t) {
  const LeggedState& state = filter_.state();
  LegEstimate estimate;
  estimate.t = t;
  estimate.T_odom_base = SE3{state.q_odom_imu, state.p_odom} * T_imu_base_;
  const Matrix6d Ad = config_.T_base_imu.adjoint();
  estimate.covariance = Ad * filter_.pose_covariance() * Ad.transpose();
  const Vector3d way = config_.noise.scale * (estimate.T_odom_base.rotation().conjugate() *
                                              estimate.T_odom_base.translation());
  estimate.covariance.bottomRightCorner<3, 3>() += way * way.transpose();
  estimate.velocity = base_velocity(turn_at(t));
  estimate.bias = {.gyro_radps = state.bias_gyro, .accel_mps2 = state.bias_accel};
  estimate.feet = contact_.feet();
  estimate.stance = stance_;
  estimate.still = still_;
  estimate.health = health_;
  return estimate;
}

}  // namespace geoflow::slam
