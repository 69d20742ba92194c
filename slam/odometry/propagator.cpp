#include "geoflow/slam/propagator.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"

#include "legs/leg_config.hpp"
#include "legs/leg_odometry.hpp"

namespace geoflow::slam {
namespace {

/// Frames' estimates come within this; what is older is forgotten.
constexpr Duration kMemory = std::chrono::seconds{1};
/// Legs that have said nothing for so long are not waited for.
constexpr Duration kSilent = std::chrono::milliseconds{50};
/// Without a frame for so long the pose is carried by less than it should be.
constexpr Duration kFramesSilent = std::chrono::milliseconds{500};
/// Of a frame's velocity, a mean over the frame's time of a body that accelerates by some m/s^2
/// (motion_model.hpp) [m/s].
constexpr double kFrameVelocity = 0.1;
/// A MEMS gyroscope's scale error.
constexpr double kGyroScale = 0.01;
/// How a walking robot's turn wanders, measured on a Go1 (docs/inertial.md) [rad/s/sqrt(s)].
constexpr double kGyroWander = 1.3;
/// What a tilt and a bias make of gravity [m/s^2].
constexpr double kLevelError = 0.2;

double squared(double x) {
  return x * x;
}

/// Dead reckoning's account at one time, since its start.
struct Reckoned {
  HostTime t;
  SE3 T_start_base;                    ///< its own levelled frame
  double turn_variance = 0;            ///< per axis, by the gyroscope's noise [rad^2]
  VelocityBelief velocity{};           ///< of base in base
  Vector3d w_base = Vector3d::Zero();  ///< mean over the last step [rad/s]
};

Reckoned between(const Reckoned& a, const Reckoned& b, HostTime t) {
  const double ratio = to_seconds(t - a.t) / to_seconds(b.t - a.t);
  const SE3& T_start_base1 = b.T_start_base;
  const SE3 T_base_base1 = a.T_start_base.inverse() * T_start_base1;
  const SE3 T_base_later = SE3::exp(ratio * T_base_base1.log());
  Reckoned c = b;
  c.t = t;
  c.T_start_base = a.T_start_base * T_base_later;  // frames: base at t
  c.turn_variance = std::lerp(a.turn_variance, b.turn_variance, ratio);
  c.velocity.v_base_mps += (ratio - 1) * (b.velocity.v_base_mps - a.velocity.v_base_mps);
  return c;
}

/// Goes on as it went, for the few milliseconds until the newest sample. That has no neighbour yet
/// that would tell a spike from a turn.
Reckoned held_until(const Reckoned& last, HostTime t) {
  const double dt = to_seconds(t - last.t);
  Reckoned now = last;
  now.t = t;
  Vector6d twist;
  twist << last.w_base, last.velocity.v_base_mps;
  const SE3 T_base0_base1 = SE3::exp(dt * twist);
  now.T_start_base = last.T_start_base * T_base0_base1;
  now.turn_variance += squared(kGyroWander * dt) * dt / 3;
  return now;
}

}  // namespace

class Propagator::Impl {
 public:
  Impl(const Calibration& calibration, const Switches& switches)
      : config_{leg_config_of(calibration)},
        legs_{switches.legs && calibration.T_base_cam},
        odometry_{config_} {}

  void add(const Timed<LegSample>& sample) { queue(sample, pending_legs_, t_legs_); }
  void add(const Timed<BodyVelocitySample>& sample) { queue(sample, pending_twists_, t_twist_); }

  std::optional<PoseEstimate> add(const Timed<ImuSample>& sample) {
    if (!imu_.empty() && sample.t <= imu_.back().t) {
      return std::nullopt;
    }
    imu_.push_back(sample);
    reckon();
    take_over_frame();
    if (!anchor_ || history_.empty() || sample.t < frame_.t) {
      return std::nullopt;
    }
    return pose(held_until(history_.back(), sample.t));
  }

  [[nodiscard]] HostTime frame_time() const noexcept { return frame_.t; }

  void correct(const PoseEstimate& frame) {
    const bool has_pose =
        frame.status != TrackingStatus::kStarting && frame.status != TrackingStatus::kInitialising;
    if (has_pose) {
      waiting_ = frame;
      take_over_frame();
    }
  }

 private:
  template <typename Sample>
  void queue(const Timed<Sample>& sample, std::vector<Timed<Sample>>& pending,
             std::optional<HostTime>& t_newest) const {
    if (legs_ && (!t_newest || sample.t > *t_newest)) {
      t_newest = sample.t;
      pending.push_back(sample);
    }
  }

  /// How far samples of all kinds reach that are heard, the IMU's newest aside.
  [[nodiscard]] HostTime reach() const {
    HostTime t = imu_.front().t;
    for (const std::optional<HostTime>& newest : {t_legs_, t_twist_}) {
      if (newest && t - *newest < kSilent) {
        t = std::min(t, *newest);
      }
    }
    return t;
  }

  void reckon() {
    const HostTime t = reach();
    const auto estimate =
        odometry_.add({.imu = imu_, .legs = pending_legs_, .body_velocity = pending_twists_}, t);
    pending_legs_.clear();
    pending_twists_.clear();
    imu_.front() = imu_.back();
    imu_.resize(1);
    if (estimate && (history_.empty() || estimate->t > history_.back().t)) {
      remember(*estimate);
    }
    while (!history_.empty() && history_.back().t - history_.front().t > kMemory) {
      history_.pop_front();
    }
  }

  void remember(const LegEstimate& estimate) {
    Reckoned next{
        .t = estimate.t, .T_start_base = estimate.T_start_base, .velocity = estimate.velocity};
    if (!history_.empty()) {
      const Reckoned& last = history_.back();
      const double dt = to_seconds(next.t - last.t);
      const Eigen::Quaterniond R_start_last = last.T_start_base.rotation();
      next.w_base = so3::log(R_start_last.conjugate() * next.T_start_base.rotation()) / dt;
      next.turn_variance = last.turn_variance + squared(config_.gyro_density()) * dt;
    }
    history_.push_back(next);
  }

  /// A frame's estimate counts from where dead reckoning was at its time.
  void take_over_frame() {
    if (!waiting_ || history_.empty() || waiting_->t > history_.back().t) {
      return;
    }
    const PoseEstimate frame = *std::exchange(waiting_, std::nullopt);
    const auto after = std::ranges::lower_bound(history_, frame.t, {}, &Reckoned::t);
    if (after->t == frame.t) {
      anchor_ = *after;
    } else if (after != history_.begin()) {
      anchor_ = between(*std::prev(after), *after, frame.t);
    } else {
      return;
    }
    frame_ = frame;
  }

  [[nodiscard]] PoseEstimate pose(const Reckoned& now) const {
    const double dt = to_seconds(now.t - anchor_->t);
    const bool by_legs = now.velocity.covariance.trace() < 3 * squared(kFrameVelocity);
    const SE3 T_reckoned = anchor_->T_start_base.inverse() * now.T_start_base;
    const SE3 T_base0_base1{T_reckoned.rotation(),
                            by_legs ? T_reckoned.translation() : way_by_frame(now)};
    PoseEstimate pose = frame_;
    pose.t = now.t;
    const SE3& T_odom_base0 = frame_.T_odom_base;
    pose.T_odom_base = T_odom_base0 * T_base0_base1;
    pose.w_base = now.w_base;
    pose.v_odom_base = by_legs ? Vector3d{pose.T_odom_base.rotation() * now.velocity.v_base_mps}
                               : Vector3d{frame_.v_odom_base + gained(now)};
    pose.source = by_legs && legs_ ? PoseSource::kLegs : PoseSource::kImu;
    if (dt > to_seconds(kFramesSilent) && pose.status == TrackingStatus::kTracking) {
      pose.status = TrackingStatus::kDegraded;
    }
    const Matrix6d A = T_base0_base1.inverse().adjoint();
    pose.covariance =
        A * frame_.covariance * A.transpose() + step_covariance(now, T_base0_base1, by_legs);
    return pose;
  }

  [[nodiscard]] Vector3d v_start(const Reckoned& at) const {
    return at.T_start_base.rotation() * at.velocity.v_base_mps;
  }

  /// What the frame's velocity does not explain of reckoning's way is the accelerometer's.
  [[nodiscard]] Vector3d way_by_frame(const Reckoned& now) const {
    const double dt = to_seconds(now.t - anchor_->t);
    const Vector3d beyond = now.T_start_base.translation() - anchor_->T_start_base.translation() -
                            dt * v_start(*anchor_);
    return frame_.T_odom_base.rotation().conjugate() * (dt * frame_.v_odom_base) +
           anchor_->T_start_base.rotation().conjugate() * beyond;
  }

  /// Velocity gained since the frame, in odom.
  [[nodiscard]] Vector3d gained(const Reckoned& now) const {
    return frame_.T_odom_base.rotation() *
           (anchor_->T_start_base.rotation().conjugate() * (v_start(now) - v_start(*anchor_)));
  }

  [[nodiscard]] Matrix6d step_covariance(const Reckoned& now, const SE3& T_base0_base1,
                                         bool by_legs) const {
    const double dt = to_seconds(now.t - anchor_->t);
    const Vector6d moved = T_base0_base1.log();
    Matrix6d covariance = Matrix6d::Zero();
    covariance.topLeftCorner<3, 3>().diagonal().setConstant(
        now.turn_variance - anchor_->turn_variance +
        squared(kGyroScale) * moved.head<3>().squaredNorm());
    if (by_legs) {
      covariance.bottomRightCorner<3, 3>() =
          squared(dt) * now.velocity.covariance +
          squared(config_.noise.scale) * moved.tail<3>().squaredNorm() * Matrix3d::Identity();
    } else {
      covariance.bottomRightCorner<3, 3>().diagonal().setConstant(
          squared(kFrameVelocity * dt) + squared(0.5 * kLevelError * dt * dt));
    }
    return covariance;
  }

  LegConfig config_;
  bool legs_;
  LegOdometry odometry_;
  std::vector<Timed<ImuSample>> imu_;  ///< the newest, and the one before
  std::vector<Timed<LegSample>> pending_legs_;
  std::vector<Timed<BodyVelocitySample>> pending_twists_;
  std::optional<HostTime> t_legs_;
  std::optional<HostTime> t_twist_;
  std::deque<Reckoned> history_;
  std::optional<PoseEstimate> waiting_;  ///< a frame that is later than what is reckoned
  PoseEstimate frame_;
  std::optional<Reckoned> anchor_;  ///< at the frame
};

Propagator::Propagator(std::unique_ptr<Impl> impl) : impl_{std::move(impl)} {}
Propagator::~Propagator() = default;

std::unique_ptr<Propagator> Propagator::create(const Calibration& calibration,
                                               const Switches& switches) {
  if (!switches.imu || !calibration.T_cam_imu) {
    return nullptr;
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<Propagator>{new Propagator{std::make_unique<Impl>(calibration, switches)}};
}

void Propagator::add(const Timed<LegSample>& sample) {
  impl_->add(sample);
}
void Propagator::add(const Timed<BodyVelocitySample>& sample) {
  impl_->add(sample);
}
std::optional<PoseEstimate> Propagator::add(const Timed<ImuSample>& sample) {
  return impl_->add(sample);
}
HostTime Propagator::frame_time() const noexcept {
  return impl_->frame_time();
}
void Propagator::correct(const PoseEstimate& frame) {
  impl_->correct(frame);
}

}  // namespace geoflow::slam
