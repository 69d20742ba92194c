#include "legs/contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::slam {
namespace {

/// Counts (Go1, Go2) or newtons; a real Go1's sensors rest within 3 counts.
constexpr double kLeastForceRange = 15;
/// With which a sensor's extremes move towards each other: several steps [s].
constexpr double kRangeMemory = 10;
/// Of the average of the supports: the longest step period of a walk [s].
constexpr double kWeightMemory = 1;
/// Less is no robot that stands [N].
constexpr double kLeastWeight = 20;
/// Bounds of what one source says [log-odds]: 98 percent.
constexpr double kBound = 4;
/// Moving feet do not stand, whatever the forces say: a slip is not told from a swing by less.
constexpr double kMovingBound = 6;
/// Share of a sensor's range, and of the weight, at which a foot is as likely to stand as not. Of
/// the weight: 25 N on a Go2, best in its simulated trot up to 0.5 m/s.
constexpr double kForceThreshold = 0.4;
constexpr double kSupportThreshold = 0.17;
/// How much of the range or the weight changes the odds by a factor of e.
constexpr double kForceStep = 0.1;
constexpr double kSupportStep = 0.06;
/// A foot holds from half the load at which it is as likely to stand as not; a standing robot's
/// four feet share the weight unevenly.
constexpr double kGripOdds = 1.4;
constexpr double kGripSlope = 2;
/// Speeds of a foot along and across the ground (x, y, z): while it stands, creeping, rolling and
/// giving way, and while it swings [m/s].
constexpr std::array kStanceSpeed{0.1, 0.1, 0.05};
constexpr std::array kSwingSpeed{0.7, 0.7, 0.7};
/// Height over the lowest foot that a standing foot rarely has on even ground, the change that
/// makes a difference, and how little that says [m, log-odds].
constexpr double kLowHeight = 0.02;
constexpr double kHeightStep = 0.01;
constexpr double kHeightBound = 1.5;
/// How long a foot is taken to go on as it did when its encoders are not heard [s].
constexpr double kUnheard = 0.05;
/// Hysteresis.
constexpr double kTouch = 0.7;
constexpr double kLift = 0.3;

double bounded(double log_odds) {
  return std::clamp(log_odds, -kBound, kBound);
}

double probability_of(double log_odds) {
  return 1 / (1 + std::exp(-log_odds));
}

/// log N(v; 0, S + stance^2) - log N(v; 0, S + swing^2), bounded.
double kinematic_log_odds(const Vector3d& v, const Matrix3d& covariance) {
  const auto log_density = [&](const std::array<double, 3>& speed) {
    const Vector3d sigma{speed[0], speed[1], speed[2]};
    const Matrix3d S = covariance + Matrix3d{sigma.cwiseAbs2().asDiagonal()};
    return -0.5 * (v.dot(S.inverse() * v) + std::log(S.determinant()));
  };
  return std::clamp(log_density(kStanceSpeed) - log_density(kSwingSpeed), -kMovingBound, kBound);
}

}  // namespace

void ForceRange::update(double force, double dt_s) {
  if (!started_) {
    started_ = true;
    lowest_ = highest_ = force;
  }
  const double shrink = 0.5 * (highest_ - lowest_) * std::min(1.0, dt_s / kRangeMemory);
  force_ = force;
  lowest_ = std::min(force, lowest_ + shrink);
  highest_ = std::max(force, highest_ - shrink);
}

std::optional<double> ForceRange::level() const {
  if (!started_ || highest_ - lowest_ < kLeastForceRange) {
    return std::nullopt;
  }
  return (force_ - lowest_) / (highest_ - lowest_);
}

void ContactEstimator::update_weight(
    const std::array<std::optional<FootEvidence>, kLegCount>& evidence, double dt_s) {
  double sum = 0;
  for (const auto& foot : evidence) {
    if (!foot || !foot->support_n) {
      return;
    }
    sum += *foot->support_n;
  }
  const double gain = std::min(1.0, dt_s / kWeightMemory);
  weight_n_ = weight_n_ ? *weight_n_ + gain * (sum - *weight_n_) : sum;
}

void ContactEstimator::judge(std::size_t leg, const FootEvidence& evidence) {
  double sum = kinematic_log_odds(evidence.v_odom_mps, evidence.v_covariance);
  bool load_known = false;
  FootState& foot = feet_.at(leg);
  foot.grip = 1;
  const auto add = [&](double log_odds) {
    load_known = true;
    sum += bounded(log_odds);
    foot.grip = std::min(foot.grip, probability_of(kGripSlope * (log_odds + kGripOdds)));
  };
  const std::optional<double> level =
      evidence.force ? ranges_.at(leg).level() : std::optional<double>{};
  if (level) {
    add((*level - kForceThreshold) / kForceStep);
  }
  if (evidence.support_n && weight_n_ && *weight_n_ > kLeastWeight) {
    add((*evidence.support_n / *weight_n_ - kSupportThreshold) / kSupportStep);
  }
  if (!load_known) {
    sum += std::clamp((kLowHeight - evidence.height_m) / kHeightStep, -kHeightBound, kHeightBound);
  }
  foot.probability = probability_of(sum);
}

const ContactEstimator::Feet& ContactEstimator::update(
    const std::array<std::optional<FootEvidence>, kLegCount>& evidence, double dt_s) {
  update_weight(evidence, dt_s);
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    FootState& foot = feet_.at(leg);
    const std::optional<FootEvidence>& seen = evidence.at(leg);
    if (!seen) {
      const double unheard_s = foot.unheard_s + dt_s;
      foot = unheard_s > kUnheard ? FootState{} : foot;
      foot.unheard_s = unheard_s;
      foot.stance_s += foot.stands ? dt_s : 0;
      continue;
    }
    foot.unheard_s = 0;
    if (seen->force) {
      ranges_.at(leg).update(*seen->force, dt_s);
    }
    judge(leg, *seen);
    const bool stood = foot.stands;
    foot.stands = foot.probability > (stood ? kLift : kTouch);
    foot.stance_s = foot.stands && stood ? foot.stance_s + dt_s : 0;
  }
  return feet_;
}

}  // namespace geoflow::slam
