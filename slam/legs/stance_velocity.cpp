#include "legs/stance_velocity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

#include "legs/contact.hpp"
#include "legs/foot_motion.hpp"

namespace geoflow::slam {
namespace {

/// Of a Mahalanobis distance with 3 degrees of freedom: 99.73 % ("3 sigma").
constexpr double kSlipGate = 14.16;
constexpr int kSlipSamples = 3;
/// What a slipping foot's velocity is off by [m/s].
constexpr double kSlipSpeed = 0.5;
/// Huber's threshold in standard deviations: 95 % efficient for normal noise.
constexpr double kHuber = 1.345;
constexpr int kReweightings = 4;

double square(double x) {
  return x * x;
}

}  // namespace

StanceVelocityEstimator::Votes StanceVelocityEstimator::votes(
    const FootMotions& motions, const ContactEstimator::Feet& feet) const {
  Votes votes;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!motions.at(leg) || !feet.at(leg).stands) {
      continue;
    }
    const FootMotion& motion = *motions.at(leg);
    const Matrix3d S = motion.v_covariance +
                       square(noise_.speed_after(feet.at(leg).stance_s)) * Matrix3d::Identity();
    votes.at(leg) = {.v = motion.v_base, .covariance = S, .information = S.inverse()};
  }
  return votes;
}

double StanceVelocityEstimator::disagreement(std::size_t leg, const Votes& votes,
                                             const std::optional<VelocityBelief>& prediction) {
  Matrix3d information = Matrix3d::Zero();
  Vector3d weighted = Vector3d::Zero();
  int others = 0;
  if (prediction) {
    information = prediction->covariance.inverse();
    weighted = information * prediction->v_base_mps;
  }
  for (std::size_t other = 0; other < kLegCount; ++other) {
    if (other != leg && votes.at(other)) {
      information += votes.at(other)->information;
      weighted += votes.at(other)->information * votes.at(other)->v;
      ++others;
    }
  }
  if (others + (prediction ? 2 : 0) < 2) {
    return 0;
  }
  const Matrix3d covariance = information.inverse();
  const Vector3d difference = votes.at(leg)->v - covariance * weighted;
  return difference.dot((covariance + votes.at(leg)->covariance).inverse() * difference);
}

void StanceVelocityEstimator::find_slips(const Votes& votes,
                                         const std::optional<VelocityBelief>& prediction) {
  Votes rest = votes;
  std::array<bool, kLegCount> disagrees{};
  for (std::size_t round = 0; round < kLegCount; ++round) {
    double worst = kSlipGate;
    std::optional<std::size_t> worst_leg;
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const double distance = rest.at(leg) ? disagreement(leg, rest, prediction) : 0.0;
      if (distance > worst) {
        worst = distance;
        worst_leg = leg;
      }
    }
    if (!worst_leg) {
      break;
    }
    disagrees.at(*worst_leg) = true;
    rest.at(*worst_leg).reset();
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    int& count = disagreements_.at(leg);
    count = disagrees.at(leg) ? std::min(count + 1, kSlipSamples) : 0;
  }
}

double StanceVelocityEstimator::pair_rate(const FootMotions& motions, const Votes& votes) {
  double largest = 0;
  for (std::size_t a = 0; a < kLegCount; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (votes.at(a) && votes.at(b)) {
        const Vector3d along =
            (motions.at(a)->contact.point - motions.at(b)->contact.point).normalized();
        const Matrix3d covariance = votes.at(a)->covariance + votes.at(b)->covariance;
        const double rate = along.dot(votes.at(a)->v - votes.at(b)->v);
        largest = std::max(largest, std::abs(rate) / std::sqrt(along.dot(covariance * along)));
      }
    }
  }
  return largest;
}

VelocityBelief StanceVelocityEstimator::combine(const Votes& votes) {
  std::array<double, kLegCount> weights{};
  weights.fill(1);
  VelocityBelief belief;
  for (int step = 0; step < kReweightings; ++step) {
    Matrix3d information = Matrix3d::Zero();
    Vector3d weighted = Vector3d::Zero();
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      if (votes.at(leg)) {
        information += weights.at(leg) * votes.at(leg)->information;
        weighted += weights.at(leg) * votes.at(leg)->information * votes.at(leg)->v;
      }
    }
    belief.covariance = information.inverse();
    belief.v_base_mps = belief.covariance * weighted;
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      if (votes.at(leg)) {
        const Vector3d off = votes.at(leg)->v - belief.v_base_mps;
        const double distance = std::sqrt(off.dot(votes.at(leg)->information * off));
        weights.at(leg) = distance > kHuber ? kHuber / distance : 1.0;
      }
    }
  }
  return belief;
}

StanceVelocity StanceVelocityEstimator::update(const FootMotions& motions,
                                               const ContactEstimator::Feet& feet,
                                               const std::optional<VelocityBelief>& prediction) {
  Votes all = votes(motions, feet);
  find_slips(all, prediction);
  StanceVelocity result;
  result.pair_rate = pair_rate(motions, all);
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!all.at(leg)) {
      continue;
    }
    ++result.legs;
    if (disagreements_.at(leg) >= kSlipSamples) {
      result.slips.at(leg) = true;
      Vote& vote = *all.at(leg);
      vote.covariance += square(kSlipSpeed) * Matrix3d::Identity();
      vote.information = vote.covariance.inverse();
    }
  }
  if (result.legs > 0) {
    result.velocity = combine(all);
  }
  return result;
}

}  // namespace geoflow::slam
