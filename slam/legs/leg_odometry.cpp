#include "legs/leg_odometry.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <deque>
#include <limits>
#include <optional>
#include <span>

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
#include "legs/leg_preintegration.hpp"
#include "legs/stance_velocity.hpp"
#include "legs/standing.hpp"

namespace geoflow::slam {
namespace {

/// Of a normalised innovation squared with 3 degrees of freedom: 99.9 %.
constexpr double kGate = 16.3;
/// How long a foot that is seen to move goes on moving [s]: with its speed it says how far.
constexpr double kDragMemory = 0.02;
/// Without leg samples for this long, a twist takes their place.
constexpr Duration kLegsSilent = std::chrono::milliseconds{100};
/// Steps below this are rounding [s].
constexpr double kLeastStep = 1e-4;
/// Zero velocity is measured this often, not at each sample: its error is the robot's sway.
constexpr Duration kRestInterval = std::chrono::milliseconds{100};
constexpr double kRestSpeed = 3e-3;  // [m/s]
/// Least error of a mean gyroscope at rest: a robot's slow sway [rad/s].
constexpr double kRestTurn = 3e-4;
/// Standard deviation of a bias that images tell: 0.2 mrad over a window of two to three seconds,
/// ten of which overlap [rad/s].
constexpr double kBiasBySight = 5e-4;

double square(double x) {
  return x * x;
}

bool same_joints(const LegSample& a, const LegSample& b) {
  return std::ranges::equal(a.joints, b.joints, [](const JointState& x, const JointState& y) {
    return x.q_rad == y.q_rad && x.dq_radps == y.dq_radps && x.tau_nm == y.tau_nm;
  });
}

template <typename Sample>
void push_newer(std::span<const Timed<Sample>> samples, std::optional<HostTime>& t_newest,
                std::deque<Timed<Sample>>& pending) {
  for (const Timed<Sample>& sample : samples) {
    if (!t_newest || sample.t > *t_newest) {
      t_newest = sample.t;
      pending.push_back(sample);
    }
  }
}

}  // namespace

LegOdometry::LegOdometry(const LegConfig& config, const BiasPrior& bias)
    : config_{config},
      T_imu_base_{config.T_base_imu.inverse()},
      prior_{bias},
      initialiser_{config.imu_noise, bias, T_imu_base_.rotation() * Vector3d::UnitX()},
      stillness_{config.imu_noise},
      stance_estimator_{config.noise},
      preintegrator_{config} {
  step_noise_.gyro = config.gyro_density();
  step_noise_.accel = config.accel_density();
  step_noise_.gyro_walk = config.imu_noise.gyro_random_walk;
  step_noise_.accel_walk = config.imu_noise.accel_random_walk;
}

void LegOdometry::queue(const MotionSamples& samples) {
  for (const Timed<ImuSample>& sample : samples.imu) {
    if (imu_.empty() || sample.t > imu_.newest()) {
      t_first_ = t_first_.value_or(sample.t);
      imu_.add(sample);
      if (!started_) {
        initialiser_.add(sample.t, sample.sample);
      }
    }
  }
  push_newer(samples.legs, t_newest_legs_, pending_);
  push_newer(samples.body_velocity, t_newest_twist_, pending_twists_);
}

std::optional<LegEstimate> LegOdometry::add(const MotionSamples& samples, HostTime t) {
  queue(samples);
  if (!started_) {
    try_start(t);
  }
  if (!started_ || t < t_) {
    return std::nullopt;
  }
  health_ = {};
  const auto due = [&](const auto& samples_of) {
    return !samples_of.empty() && samples_of.front().t <= t;
  };
  while (due(pending_) || due(pending_twists_)) {
    if (!due(pending_twists_) ||
        (due(pending_) && pending_.front().t <= pending_twists_.front().t)) {
      take(pending_.front());
      pending_.pop_front();
    } else {
      take(pending_twists_.front());
      pending_twists_.pop_front();
    }
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
    const ImuSample mean{.accel_mps2 = 0.5 * (a.accel_mps2 + b.accel_mps2),
                         .gyro_radps = 0.5 * (a.gyro_radps + b.gyro_radps)};
    leg_step_.dt_s = dt;
    leg_step_.gyro_radps = mean.gyro_radps;
    if (!leg_step_.contact) {
      leg_step_.velocity = base_velocity(turn_at(t_));
    }
    preintegrator_.add(leg_step_);
    filter_.propagate(mean, dt, step_noise_);
    stillness_.add(t_next, b);
    t_ = t_next;
  }
}

Matrix3d LegOdometry::odom_base_rotation() const {
  return (filter_.state().q_odom_imu * T_imu_base_.rotation()).toRotationMatrix();
}

BaseTurn LegOdometry::turn_at(HostTime t) const {
  const Matrix3d R_base_imu = config_.T_base_imu.rotation_matrix();
  return {.w_base_radps = R_base_imu * (imu_.at(t).gyro_radps - filter_.state().bias_gyro),
          .sigma_radps = config_.gyro_density() * std::sqrt(config_.imu_noise.rate_hz),
          .up_base = odom_base_rotation().transpose().col(2)};
}

VelocityBelief LegOdometry::base_velocity(const BaseTurn& turn) const {
  const Matrix3d R_base_odom = odom_base_rotation().transpose();
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
  const Matrix3d R = odom_base_rotation();
  double lowest = std::numeric_limits<double>::infinity();
  for (const std::optional<FootMotion>& motion : motions) {
    lowest = motion ? std::min(lowest, turn.up_base.dot(motion->contact.point)) : lowest;
  }
  std::array<std::optional<FootEvidence>, kLegCount> evidence;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const std::optional<FootMotion>& found = motions.at(leg);
    if (!found) {
      continue;
    }
    const FootMotion& motion = *found;
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
  use_stance(found, turn, dt);
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const FootState& state = contact_.feet().at(leg);
    double drag = 0;
    if (const std::optional<FootEvidence>& foot = seen.at(leg)) {
      drag = std::max(0.0, foot->v_odom_mps.norm() - std::sqrt(foot->v_covariance.trace()));
    }
    const double dragged = drag * drag * kDragMemory;
    step_noise_.foothold.at(leg) = (config_.noise.creep_of(state.stance_s, state.grip).cwiseAbs2() +
                                    Vector3d::Constant(dragged))
                                       .cwiseSqrt();
  }
  update_feet(found);
  rest(legs.t);
}

void LegOdometry::use_stance(const FootMotions& motions, const BaseTurn& turn, double dt_s) {
  stance_ = stance_estimator_.update(motions, contact_.feet(), base_velocity(turn));
  leg_step_.contact = stance_.legs > 0;
  if (leg_step_.contact) {
    health_.contact_s += dt_s;
    leg_step_.velocity = stance_.velocity;
    leg_step_.velocity_by_turn = stance_.by_turn;
    leg_step_.sample_s = dt_s;
  } else {
    leg_step_.velocity_by_turn.setZero();
    leg_step_.sample_s = 0;
  }
}

void LegOdometry::take(const Timed<BodyVelocitySample>& twist) {
  const bool legs_speak = last_legs_ && twist.t - last_legs_->t < kLegsSilent;
  if (legs_speak || twist.t < t_ || !twist.sample.v_base_mps.allFinite()) {
    return;
  }
  advance(twist.t);
  const double period = t_last_twist_ ? to_seconds(twist.t - *t_last_twist_) : 0.0;
  t_last_twist_ = twist.t;
  const BaseTurn turn = turn_at(twist.t);
  const Vector3d v_base =
      twist.sample.v_base_mps + turn.w_base_radps.cross(config_.T_base_imu.translation());
  // The error lasts: in that time it may be used as one measurement.
  const double repeats = std::max(1.0, config_.noise.speed_memory_s / std::max(period, kLeastStep));
  count(filter_.update_velocity(T_imu_base_.rotation() * v_base,
                                square(config_.twist_mps) * repeats * Matrix3d::Identity(), kGate));
  leg_step_.contact = true;
  leg_step_.velocity = {.v_base_mps = twist.sample.v_base_mps,
                        .covariance = square(config_.twist_mps) * Matrix3d::Identity()};
  leg_step_.velocity_by_turn.setZero();
  leg_step_.sample_s = period;
  rest(twist.t);
}

void LegOdometry::update_feet(const FootMotions& motions) {
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!contact_.feet().at(leg).stands) {
      R_odom_calf_.at(leg).reset();
    } else if (const std::optional<FootMotion>& motion = motions.at(leg)) {
      update_foot(static_cast<Leg>(leg), *motion);
    }
  }
}

void LegOdometry::update_foot(Leg leg, const FootMotion& motion) {
  const Matrix3d R_imu_base = T_imu_base_.rotation_matrix();
  const Vector3d foot_in_imu = T_imu_base_ * motion.centre;
  const Matrix3d covariance = R_imu_base * motion.centre_covariance * R_imu_base.transpose();
  std::optional<Matrix3d>& R_odom_calf = R_odom_calf_.at(static_cast<std::size_t>(leg));
  const Matrix3d R_now = odom_base_rotation() * motion.R_base_calf;
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
  R_odom_calf = odom_base_rotation() * motion.R_base_calf;
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

void LegOdometry::see_gyro_bias(const Vector3d& bias_radps) {
  if (started()) {
    filter_.update_gyro_bias(bias_radps, square(kBiasBySight) * Matrix3d::Identity());
  }
}

LegEstimate LegOdometry::estimate(HostTime t) {
  const LeggedState& state = filter_.state();
  LegEstimate estimate;
  estimate.t = t;
  estimate.T_odom_base = SE3{state.q_odom_imu, state.p_odom} * T_imu_base_;
  estimate.T_start_base = config_.T_base_imu * filter_.way() * T_imu_base_;
  const Matrix6d adjoint = config_.T_base_imu.adjoint();
  estimate.covariance = adjoint * filter_.pose_covariance() * adjoint.transpose();
  const Vector3d way = config_.noise.scale * (estimate.T_odom_base.rotation().conjugate() *
                                              estimate.T_odom_base.translation());
  estimate.covariance.bottomRightCorner<3, 3>() += way * way.transpose();
  estimate.velocity = base_velocity(turn_at(t));
  estimate.bias = {.gyro_radps = state.bias_gyro, .accel_mps2 = state.bias_accel};
  estimate.gyro_bias_covariance =
      filter_.covariance().block<3, 3>(ContactFilter::kGyroBias, ContactFilter::kGyroBias);
  estimate.up = filter_.up();
  estimate.feet = contact_.feet();
  estimate.stance = stance_;
  estimate.still = still_;
  estimate.health = health_;
  estimate.increment = preintegrator_.increment(t);
  preintegrator_.begin(t, state.bias_gyro);
  return estimate;
}

}  // namespace geoflow::slam
