#include "inertial/health.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/nav_state.hpp"

namespace geoflow::slam {
namespace {

constexpr double kForgetting = 0.9;
constexpr double kMostOfOne = 50.0;
constexpr double kSignificant = 3.0;
constexpr double kDoubt = 2.0;
constexpr double kContradict = 9.0;
constexpr double kAgreeAgain = 1.5;
constexpr double kDoubtAgain = 4.0;
constexpr Duration kSilence = std::chrono::milliseconds{500};

constexpr auto kCamera = static_cast<std::size_t>(ImuWitness::kCamera);
constexpr auto kLegs = static_cast<std::size_t>(ImuWitness::kLegs);
constexpr auto kConstantVelocity = static_cast<std::size_t>(ImuWitness::kConstantVelocity);

}  // namespace

Innovation pose_innovation(const UncertainState& predicted, const SE3& T_odom_imu,
                           const Matrix6d& covariance) {
  const Vector6d difference = (predicted.state.T_odom_imu.inverse() * T_odom_imu).log();
  const Matrix6d own = predicted.covariance.topLeftCorner<6, 6>();
  return innovation<6>(difference, own + covariance);
}

Innovation velocity_innovation(const UncertainState& predicted, const Vector3d& v_odom,
                               const Matrix3d& covariance) {
  const Matrix3d own = predicted.covariance.block<3, 3>(kVelocityAt, kVelocityAt);
  return innovation<3>(v_odom - predicted.state.v_odom, own + covariance);
}

const char* to_string(ImuVerdict verdict) noexcept {
  switch (verdict) {
    case ImuVerdict::kHealthy:
      return "healthy";
    case ImuVerdict::kSuspect:
      return "suspect";
    case ImuVerdict::kDiverged:
      return "diverged";
  }
  return "?";
}

void ImuHealth::Record::add(const Innovation& innovation) {
  const double dimensions = innovation.dimensions;
  // What is not a number is no agreement.
  const double per_dimension = innovation.squared / dimensions;
  sum = kForgetting * sum + (per_dimension < kMostOfOne ? per_dimension : kMostOfOne);
  weight = kForgetting * weight + 1;
  weight_squared = kForgetting * kForgetting * weight_squared + 1 / dimensions;
}

/// The mean times `freedom` is chi-square with that many degrees; its cube root is nearly normal.
bool ImuHealth::Record::significant() const {
  constexpr double kWilsonHilferty = 2.0 / 9;
  const double freedom = weight * weight / weight_squared;
  const double variance = kWilsonHilferty / freedom;
  return (std::cbrt(mean()) - (1 - variance)) / std::sqrt(variance) > kSignificant;
}

void ImuHealth::Record::form_opinion() {
  const double value = mean();
  const bool beyond_chance = significant();
  if ((beyond_chance && value > kContradict) ||
      (opinion == Opinion::kContradicts && value > kDoubtAgain)) {
    opinion = Opinion::kContradicts;
    return;
  }
  const bool doubted = opinion == Opinion::kDoubts || opinion == Opinion::kContradicts;
  const bool doubts = (beyond_chance && value > kDoubt) || (doubted && value >= kAgreeAgain);
  opinion = doubts ? Opinion::kDoubts : Opinion::kAgrees;
}

ImuVerdict ImuHealth::verdict() const {
  const auto strong = [&](Opinion opinion) {
    return (records_[kCamera].opinion == opinion ? 1 : 0) +
           (records_[kLegs].opinion == opinion ? 1 : 0);
  };
  const Opinion weak = records_[kConstantVelocity].opinion;
  const int contradicting = strong(Opinion::kContradicts) + (weak == Opinion::kContradicts ? 1 : 0);
  if (contradicting > strong(Opinion::kAgrees)) {
    return ImuVerdict::kDiverged;
  }
  return contradicting + strong(Opinion::kDoubts) > 0 ? ImuVerdict::kSuspect : ImuVerdict::kHealthy;
}

double ImuHealth::scale() const {
  double best = std::numeric_limits<double>::infinity();
  for (const std::size_t witness : {kCamera, kLegs}) {
    if (records_[witness].opinion != Opinion::kSilent) {
      best = std::min(best, records_[witness].mean());
    }
  }
  if (std::isinf(best)) {
    const Record& weak = records_[kConstantVelocity];
    best = weak.opinion == Opinion::kContradicts ? weak.mean() : 1;
  }
  return judgement_.verdict == ImuVerdict::kHealthy ? 1 : std::max(1.0, best);
}

ImuJudgement ImuHealth::update(HostTime t, const ImuInnovations& innovations) {
  for (std::size_t i = 0; i < kImuWitnesses; ++i) {
    Record& record = records_[i];
    if (record.opinion != Opinion::kSilent && t - record.last > kSilence) {
      record = Record{};
    }
    if (const auto& innovation = innovations[i]) {
      record.add(*innovation);
      record.last = t;
      record.form_opinion();
    }
    judgement_.mean_squared[i] = record.mean();
  }
  judgement_.verdict = verdict();
  judgement_.variance_scale = scale();
  judgement_.predictor = PoseSource::kImu;
  if (judgement_.verdict == ImuVerdict::kDiverged) {
    judgement_.predictor =
        records_[kLegs].opinion != Opinion::kSilent ? PoseSource::kLegs : PoseSource::kNone;
  }
  return judgement_;
}

}  // namespace geoflow::slam
