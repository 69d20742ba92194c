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
    const std::optional<FootMotion>& motion = motions.at(leg);
    if (motion && feet.at(leg).stands) {
      const Matrix3d S =
          motion->v_covariance +
          square(noise_.speed_of(feet.at(leg).stance_s, feet.at(leg).grip)) * Matrix3d::Identity();
      votes.at(leg) = {.v = motion->v_base,
                       .covariance = S,
                       .information = S.inverse(),
                       .point = motion->contact.point};
    }
  }
  return votes;
}

double StanceVelocityEstimator::disagreement(std::size_t leg, const Votes& votes,
                                             const std::optional<VelocityBelief>& prediction) {
  const std::optional<Vote>& judged = votes.at(leg);
  if (!judged) {
    return 0;
  }
  Matrix3d information = Matrix3d::Zero();
  Vector3d weighted = Vector3d::Zero();
  int others = 0;
  if (prediction) {
    information = prediction->covariance.inverse();
    weighted = information * prediction->v_base_mps;
  }
  for (std::size_t other = 0; other < kLegCount; ++other) {
    const std::optional<Vote>& vote = votes.at(other);
    if (other != leg && vote) {
      information += vote->information;
      weighted += vote->information * vote->v;
      ++others;
    }
  }
  if (others + (prediction ? 2 : 0) < 2) {
    return 0;
  }
  const Matrix3d covariance = information.inverse();
  const Vector3d difference = judged->v - covariance * weighted;
  return difference.dot((covariance + judged->covariance).inverse() * difference);
}

void StanceVelocityEstimator::find_slips(const Votes& votes,
                                         const std::optional<VelocityBelief>& prediction) {
  Votes rest = votes;
  std::array<bool, kLegCount> disagrees{};
  for (std::size_t round = 0; round < kLegCount; ++round) {
    double worst = kSlipGate;
    std::optional<std::size_t> worst_leg;
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const double distance = disagreement(leg, rest, prediction);
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

double StanceVelocityEstimator::pair_rate(const Votes& votes) {
  double largest = 0;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    for (std::size_t other = 0; other < leg; ++other) {
      const std::optional<Vote>& a = votes.at(leg);
      const std::optional<Vote>& b = votes.at(other);
      if (a && b) {
        const Vector3d along = (a->point - b->point).normalized();
        const Matrix3d covariance = a->covariance + b->covariance;
        const double rate = along.dot(a->v - b->v);
        largest = std::max(largest, std::abs(rate) / std::sqrt(along.dot(covariance * along)));
      }
    }
  }
  return largest;
}

void StanceVelocityEstimator::combine(const Votes& votes, StanceVelocity& result) {
  std::array<double, kLegCount> weights{};
  weights.fill(1);
  VelocityBelief& belief = result.velocity;
  for (int step = 0; step < kReweightings; ++step) {
    Matrix3d information = Matrix3d::Zero();
    Matrix3d by_turn = Matrix3d::Zero();
    Vector3d weighted = Vector3d::Zero();
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const std::optional<Vote>& vote = votes.at(leg);
      if (vote) {
        const Matrix3d share = weights.at(leg) * vote->information;
        information += share;
        weighted += share * vote->v;
        by_turn += share * skew(vote->point);
      }
    }
    belief.covariance = information.inverse();
    belief.v_base_mps = belief.covariance * weighted;
    result.by_turn = belief.covariance * by_turn;
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const std::optional<Vote>& vote = votes.at(leg);
      if (vote) {
        const Vector3d off = vote->v - belief.v_base_mps;
        const double distance = std::sqrt(off.dot(vote->information * off));
        weights.at(leg) = distance > kHuber ? kHuber / distance : 1.0;
      }
    }
  }
}

StanceVelocity StanceVelocityEstimator::update(const FootMotions& motions,
                                               const ContactEstimator::Feet& feet,
                                               const std::optional<VelocityBelief>& prediction) {
  Votes all = votes(motions, feet);
  find_slips(all, prediction);
  StanceVelocity result;
  result.pair_rate = pair_rate(all);
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    std::optional<Vote>& vote = all.at(leg);
    if (!vote) {
      continue;
    }
    ++result.legs;
    if (disagreements_.at(leg) >= kSlipSamples) {
      result.slips.at(leg) = true;
      vote->covariance += square(kSlipSpeed) * Matrix3d::Identity();
      vote->information = vote->covariance.inverse();
    }
  }
  if (result.legs > 0) {
    combine(all, result);
  }
  return result;
}

}  // namespace geoflow::slam
