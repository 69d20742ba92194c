#pragma once

#include <array>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

/// Which feet stand: evidence of several kinds, each of which may be missing, added up as log-odds.
namespace geoflow::slam {

/// What is known of one foot at one instant.
struct FootEvidence {
  /// The foot's sensor, in whatever unit and with whatever offset it has; none: no sensor.
  std::optional<double> force;
  /// The ground's upward push by the joints' torques [N]; none: no torques.
  std::optional<double> support_n;
  /// Velocity over ground of the point that would touch, by the kinematics and the predicted motion
  /// of the body, in odom (z up) [m/s].
  Vector3d v_odom_mps = Vector3d::Zero();
  Matrix3d v_covariance = Matrix3d::Zero();  ///< of that velocity [m^2/s^2]
  double height_m = 0;                       ///< of the point over the lowest foot's [m]
};

/// One foot's state as believed.
struct FootState {
  double probability = 0;  ///< that it stands
  bool stands = false;     ///< the same with hysteresis: from 0.7 until 0.3
  /// How sure it is that the ground bears on it, by the least of what its sensor and its torques
  /// say; 1 where neither tells. A foot that stands without a load may slide, or be about to lift.
  double grip = 1;
  double stance_s = 0;   ///< since it stands [s]
  double unheard_s = 0;  ///< since its encoders were heard [s]
};

/// The range of a sensor whose zero and scale are unknown: extremes that widen at once and shrink
/// slowly towards each other. Source of the idea: Cerberus (Yang et al., ICRA 2023), which
/// follows them by sample instead of by time.
class ForceRange {
 public:
  void update(double force, double dt_s);
  /// Where the newest force lies between the extremes (0 lowest, 1 highest); none while they are so
  /// near to each other that the difference may be noise.
  [[nodiscard]] std::optional<double> level() const;

 private:
  bool started_ = false;
  double force_ = 0;
  double lowest_ = 0;
  double highest_ = 0;
};

/// Contact of all feet. Log-odds of three sources are added, each bounded so that none decides
/// alone against the others:
/// - the foot's sensor: by its level in its own range;
/// - the support by torques: by a share of the weight, which is the sum of all supports averaged
///   over a second (over whole steps the ground carries the body, whatever its mass);
/// - kinematics: the likelihood ratio of the point's velocity over ground, that of a standing foot
///   against that of a swinging one.
/// The two about the load also say how sure it is that the foot holds (FootState::grip): sensors
/// fall late, and a foot that lifts would pull the body back by what it moves until then. Where
/// neither sensor nor torque tells who is loaded, the lowest feet are a little likelier to stand.
/// It decides when the body's velocity has been lost, and only then. Thread-compatible; time comes
/// with each call.
class ContactEstimator {
 public:
  using Feet = std::array<FootState, kLegCount>;

  /// Takes over one instant's evidence, `dt_s` after the one before. A foot without evidence (its
  /// encoders were not heard) stays as it was for 0.05 s, then it does not stand.
  const Feet& update(const std::array<std::optional<FootEvidence>, kLegCount>& evidence,
                     double dt_s);

  [[nodiscard]] const Feet& feet() const noexcept { return feet_; }

 private:
  void update_weight(const std::array<std::optional<FootEvidence>, kLegCount>& evidence,
                     double dt_s);
  void judge(std::size_t leg, const FootEvidence& evidence);

  std::array<ForceRange, kLegCount> ranges_;
  std::optional<double> weight_n_;
  Feet feet_;
};

}  // namespace geoflow::slam
