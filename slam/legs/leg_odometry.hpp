#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/up_direction.hpp"
#include "legs/contact.hpp"
#include "legs/contact_filter.hpp"
#include "legs/foot_motion.hpp"
#include "legs/imu_track.hpp"
#include "legs/leg_config.hpp"
#include "legs/leg_preintegration.hpp"
#include "legs/stance_velocity.hpp"
#include "legs/standing.hpp"

namespace geoflow::slam {

/// How the measurements of the time since the previous estimate agreed with the prediction. The
/// footholds' noise stands for errors that last over a stance, so from sample to sample a healthy
/// IMU gives a `nis` far below 1 (0.001 to 0.06 on go2-trot and go1-legs): look at its growth and
/// at `refused`.
struct LegHealth {
  double nis = 0;                ///< mean normalised innovation squared per degree of freedom [1]
  std::uint32_t updates = 0;     ///< measurements taken
  std::uint32_t refused = 0;     ///< that contradicted the prediction: slips, shocks, IMU faults
  std::uint32_t duplicates = 0;  ///< leg samples that repeated the one before
  double contact_s = 0;          ///< time with at least one standing foot [s]
};

/// What a packet brings of the robot's motion; parts may be empty.
struct MotionSamples {
  std::span<const Timed<ImuSample>> imu;
  std::span<const Timed<LegSample>> legs;
  std::span<const Timed<BodyVelocitySample>> body_velocity;
};

/// Where legs and IMU alone think the robot is.
struct LegEstimate {
  HostTime t;
  SE3 T_odom_base;  ///< odom: base at the start, levelled as is known by now
  /// The way since the start. What is learnt of the tilt turns the start as well: it is no motion.
  SE3 T_start_base;
  /// Of T_odom_base, as in hal/geometry.hpp, with the error that grows with the way
  /// (LegNoise::scale).
  Matrix6d covariance = Matrix6d::Zero();
  VelocityBelief velocity;
  ImuBias bias;
  Matrix3d gyro_bias_covariance = Matrix3d::Zero();
  UpDirection up;  ///< in the imu frame
  ContactEstimator::Feet feet{};
  StanceVelocity stance;  ///< at the newest leg sample
  bool still = false;
  /// The factor from the time of the previous estimate (or of the start) to this one.
  LegIncrement increment;
  LegHealth health;
};

/// Dead reckoning by IMU and legs: the estimate when the camera is blind, and the judge of the IMU.
///
/// It starts by itself once the robot has stood (or lain) still for a second; one that is already
/// moving is started after `kPatience` from the mean specific force, with the uncertainty that this
/// deserves. Between leg samples the contact filter integrates the IMU; at each it decides which
/// feet stand, and their places correct it. A foot whose place contradicts the prediction starts a
/// new foothold. Where no legs are heard, a robot's own odometry twist takes their place.
/// Deterministic; thread-compatible.
class LegOdometry {
 public:
  explicit LegOdometry(const LegConfig& config, const BiasPrior& bias = BiasPrior::cold());

  /// Takes samples, in order of time; those known already (packets overlap) are ignored. Moves on
  /// to `t`, using samples up to it and interpolating the IMU with the one behind; later ones are
  /// kept for the next call. None as long as it is not started.
  std::optional<LegEstimate> add(const MotionSamples& samples, HostTime t);

  /// Starts from a known state at `fix.t`, whatever it was before.
  void start(const StandingFix& fix);

  [[nodiscard]] bool started() const noexcept { return started_; }

  /// The gyroscope's bias as images of the last seconds tell it [rad/s, imu frame]; nothing before
  /// the start. To be told some times a second: what is told counts as one of ten that overlap.
  void see_gyro_bias(const Vector3d& bias_radps);

 private:
  /// One foot's orientation in odom when it was last seen to stand, for how far it has rolled
  /// since.
  using CalfRotations = std::array<std::optional<Matrix3d>, kLegCount>;

  void queue(const MotionSamples& samples);
  void try_start(HostTime t);
  void advance(HostTime t);
  void take(const Timed<LegSample>& legs);
  void take(const Timed<BodyVelocitySample>& twist);
  [[nodiscard]] FootMotions motions(const LegSample& legs, const BaseTurn& turn) const;
  [[nodiscard]] std::array<std::optional<FootEvidence>, kLegCount> evidence(
      const LegSample& legs, const FootMotions& motions, const BaseTurn& turn);
  void use_stance(const FootMotions& motions, const BaseTurn& turn, double dt_s);
  void update_feet(const FootMotions& motions);
  void update_foot(Leg leg, const FootMotion& motion);
  void rest(HostTime t);
  void count(double nis);
  [[nodiscard]] BaseTurn turn_at(HostTime t) const;
  [[nodiscard]] VelocityBelief base_velocity(const BaseTurn& turn) const;
  [[nodiscard]] Matrix3d odom_base_rotation() const;
  [[nodiscard]] LegEstimate estimate(HostTime t);

  LegConfig config_;
  SE3 T_imu_base_;
  BiasPrior prior_;
  StandingInitialiser initialiser_;
  StillnessDetector stillness_;
  ContactEstimator contact_;
  StanceVelocityEstimator stance_estimator_;
  ContactFilter filter_;
  ImuTrack imu_;
  std::deque<Timed<LegSample>> pending_;
  std::deque<Timed<BodyVelocitySample>> pending_twists_;
  LegPreintegrator preintegrator_;

  bool started_ = false;
  std::optional<HostTime> t_first_;
  HostTime t_;
  std::optional<Timed<LegSample>> last_legs_;
  std::optional<HostTime> t_newest_legs_;
  std::optional<HostTime> t_newest_twist_;
  std::optional<HostTime> t_last_twist_;
  std::optional<HostTime> t_rest_;
  CalfRotations R_odom_calf_;
  ContactFilter::StepNoise step_noise_;
  bool torques_seen_ = false;
  bool still_ = false;
  StanceVelocity stance_;
  LegStep leg_step_;  ///< velocity of the newest sample, held until the next
  LegHealth health_;
};

}  // namespace geoflow::slam
