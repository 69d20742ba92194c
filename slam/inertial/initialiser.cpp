#include "inertial/initialiser.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

namespace geoflow::slam {
namespace {

constexpr Duration kBlock = std::chrono::milliseconds{50};
constexpr Duration kGap = std::chrono::milliseconds{100};
constexpr std::size_t kLeastBlocks = 20;
constexpr std::size_t kMostBlocks = 100;
/// Blocks in a batch, for the variance of the mean: 0.2 s, longer than the samples' correlation.
constexpr std::size_t kBatch = 4;

/// Standard deviation of block means by motion. Measured on EuRoC's drone on the ground with its
/// rotors on: at most 0.008 and 0.11; at the slowest moment of it in the air 0.07 and 0.14, of a
/// Go1 that stands up 0.028 and 0.17.
constexpr double kGyroMoving = 0.015;  // [rad/s]
constexpr double kAccelMoving = 0.15;  // [m/s^2]
/// Standard deviation inside a block beyond which it is no vibration of motors: that drone has 0.05
/// and 0.6.
constexpr double kGyroShaking = 0.15;  // [rad/s]
constexpr double kAccelShaking = 2.0;  // [m/s^2]
/// Share of the white noise's own variance that is allowed on top: 1 + 3 sqrt(2 / 19), three
/// standard deviations of a variance of twenty values; and how many standard deviations of a mean.
constexpr double kNoiseMargin = 2.0;
constexpr double kNoiseSigmas = 3.0;
/// A gyroscope at rest shows less than this.
constexpr double kMostGyroBias = 0.1;  // [rad/s]

constexpr double kColdGyroSigma = 0.05;  // [rad/s]
constexpr double kColdAccelSigma = 0.2;  // [m/s^2]
/// Quantile 1 - 1e-4 of chi-square with three degrees of freedom, and of a normal (two-sided).
constexpr double kChiSquare3 = 21.1;
constexpr double kNormal = 3.9;

/// Two tangents of the unit sphere at u, columns of unit length.
Eigen::Matrix<double, 3, 2> tangents_at(const Vector3d& u) {
  Eigen::Matrix<double, 3, 2> E;
  E.col(0) = u.unitOrthogonal();
  E.col(1) = u.cross(E.col(0));
  return E;
}

/// The specific force at rest f = g u + b, solved for the direction u and the bias b with its
/// prior.
class RestSolver {
 public:
  RestSolver(const Vector3d& force, const Vector3d& variance, const Vector3d& bias,
             const Matrix3d& bias_covariance)
      : force_{force}, bias_prior_{bias}, bias_{bias}, up_{(force - bias).normalized()} {
    force_information_ = variance.cwiseInverse().asDiagonal();
    bias_information_ = bias_covariance.inverse();
    constexpr int kIterations = 5;  // quadratic convergence from within a degree or two
    for (int i = 0; i < kIterations; ++i) {
      step();
    }
  }

  [[nodiscard]] const Vector3d& up() const { return up_; }
  [[nodiscard]] const Vector3d& bias() const { return bias_; }
  /// Of (rotation, bias), 6 x 6.
  [[nodiscard]] Matrix6d covariance() const {
    return lift_ * information_.inverse() * lift_.transpose();
  }

 private:
  static constexpr int kUnknowns = 5;

  void step() {
    const Eigen::Matrix<double, 3, 2> E = tangents_at(up_);
    lift_.setZero();
    lift_.topLeftCorner<3, 2>() = E;
    lift_.bottomRightCorner<3, 3>().setIdentity();
    Eigen::Matrix<double, 3, kUnknowns> H;
    H << kStandardGravity * skew(up_) * E, Matrix3d::Identity();
    information_ = H.transpose() * force_information_ * H;
    information_.bottomRightCorner<3, 3>() += bias_information_;
    Eigen::Matrix<double, kUnknowns, 1> right =
        H.transpose() * force_information_ * (force_ - kStandardGravity * up_ - bias_);
    right.tail<3>() += bias_information_ * (bias_prior_ - bias_);
    const Eigen::Matrix<double, kUnknowns, 1> delta = information_.ldlt().solve(right);
    up_ = (so3::exp(E * delta.head<2>()).conjugate() * up_).normalized();
    bias_ += delta.tail<3>();
  }

  Vector3d force_;
  Vector3d bias_prior_;
  Vector3d bias_;
  Vector3d up_;
  Matrix3d force_information_;
  Matrix3d bias_information_;
  Eigen::Matrix<double, kUnknowns, kUnknowns> information_;
  Eigen::Matrix<double, 6, kUnknowns> lift_;
};

bool contradicts(const BiasPrior& prior, const Vector6d& mean, const Vector6d& variance) {
  const Vector3d gyro = mean.head<3>() - prior.bias.gyro_radps;
  const Matrix3d gyro_covariance =
      prior.covariance.topLeftCorner<3, 3>() + Matrix3d{variance.head<3>().asDiagonal()};
  const Vector3d force = mean.tail<3>() - prior.bias.accel_mps2;
  const Vector3d up = force.normalized();
  const Matrix3d accel_covariance =
      prior.covariance.bottomRightCorner<3, 3>() + Matrix3d{variance.tail<3>().asDiagonal()};
  const double excess = std::abs(force.norm() - kStandardGravity);
  return gyro.dot(gyro_covariance.ldlt().solve(gyro)) > kChiSquare3 ||
         excess > kNormal * std::sqrt(up.dot(accel_covariance * up));
}

}  // namespace

BiasPrior BiasPrior::cold() {
  BiasPrior prior;
  prior.covariance.diagonal() << Vector3d::Constant(kColdGyroSigma * kColdGyroSigma),
      Vector3d::Constant(kColdAccelSigma * kColdAccelSigma);
  return prior;
}

Eigen::Quaterniond level_rotation(const Vector3d& up_imu, const Vector3d& forward_imu) {
  const Vector3d level = forward_imu - up_imu * up_imu.dot(forward_imu);
  constexpr double kParallel = 1e-6;
  const Vector3d x =
      level.norm() > kParallel * forward_imu.norm() ? level.normalized() : up_imu.unitOrthogonal();
  Matrix3d R_odom_imu;
  R_odom_imu.row(0) = x.transpose();
  R_odom_imu.row(1) = up_imu.cross(x).transpose();
  R_odom_imu.row(2) = up_imu.transpose();
  return Eigen::Quaterniond{R_odom_imu}.normalized();
}

StandingInitialiser::StandingInitialiser(const ImuNoise& noise, const BiasPrior& prior,
                                         const Vector3d& forward_imu)
    : noise_{noise}, prior_{prior}, forward_imu_{forward_imu} {}

void StandingInitialiser::restart() {
  blocks_.clear();
  open_ = Block{};
}

void StandingInitialiser::add(HostTime t, const ImuSample& sample) {
  Vector6d values;
  values << sample.gyro_radps, sample.accel_mps2;
  const bool first = open_.samples == 0;
  if (!values.allFinite() || (!first && t <= open_.t_end) ||
      (first && !blocks_.empty() && t <= blocks_.back().t_end)) {
    return;
  }
  if ((!first && t - open_.t_end > kGap) ||
      (first && !blocks_.empty() && t - blocks_.back().t_end > kGap)) {
    restart();
  }
  if (open_.samples == 0) {
    open_.t_begin = t;
  }
  open_.t_end = t;
  open_.sum += values;
  open_.sum_of_squares += values.cwiseAbs2();
  ++open_.samples;
  if (t - open_.t_begin >= kBlock) {
    close_block();
  }
}

void StandingInitialiser::close_block() {
  const auto n = static_cast<double>(open_.samples);
  open_.sum /= n;
  const Vector6d variance = open_.sum_of_squares / n - open_.sum.cwiseAbs2();
  const bool shaking = variance.head<3>().maxCoeff() > kGyroShaking * kGyroShaking ||
                       variance.tail<3>().maxCoeff() > kAccelShaking * kAccelShaking;
  const Block closed = open_;
  open_ = Block{};
  if (shaking) {
    blocks_.clear();
    return;
  }
  blocks_.push_back(closed);
  if (blocks_.size() > kMostBlocks) {
    blocks_.pop_front();
  }
  if (!blocks_agree()) {
    // What came before does not belong to where it stands now, if it stands.
    blocks_.erase(blocks_.begin(), blocks_.end() - 1);
  }
}

Vector6d StandingInitialiser::mean(std::size_t first, std::size_t last) const {
  Vector6d sum = Vector6d::Zero();
  for (std::size_t i = first; i < last; ++i) {
    sum += blocks_[i].sum;
  }
  return sum / static_cast<double>(last - first);
}

bool StandingInitialiser::blocks_agree() const {
  const std::size_t n = blocks_.size();
  if (n < 2) {
    return true;
  }
  const std::size_t recent = std::min(n, kLeastBlocks);
  const Vector6d centre = mean(n - recent, n);
  Vector6d variance = Vector6d::Zero();
  for (std::size_t i = n - recent; i < n; ++i) {
    variance += (blocks_[i].sum - centre).cwiseAbs2();
  }
  variance /= static_cast<double>(recent);
  const Vector6d drift = mean(0, n / 2) - mean(n / 2, n);
  Vector6d moving;
  moving << Vector3d::Constant(kGyroMoving * kGyroMoving),
      Vector3d::Constant(kAccelMoving * kAccelMoving);
  const Vector6d white = white_variance(to_seconds(kBlock));
  // The white noise of two halves of n blocks each.
  const Vector6d halves = white * 4 / static_cast<double>(n);
  return (variance.array() < (moving + kNoiseMargin * white).array()).all() &&
         (drift.array().square() < (moving + kNoiseSigmas * kNoiseSigmas * halves).array()).all();
}

Vector6d StandingInitialiser::white_variance(double seconds) const {
  Vector6d variance;
  variance << Vector3d::Constant(noise_.gyro_noise_density * noise_.gyro_noise_density / seconds),
      Vector3d::Constant(noise_.accel_noise_density * noise_.accel_noise_density / seconds);
  return variance;
}

bool StandingInitialiser::standing() const {
  return blocks_.size() >= kLeastBlocks;
}

/// By batch means (Law and Kelton, "Simulation Modeling and Analysis", 9.5.3), at least what the
/// white noise leaves.
Vector6d StandingInitialiser::variance_of_mean() const {
  const std::size_t batches = blocks_.size() / kBatch;
  const std::size_t first = blocks_.size() - batches * kBatch;
  const Vector6d centre = mean(first, blocks_.size());
  Vector6d variance = Vector6d::Zero();
  for (std::size_t i = 0; i < batches; ++i) {
    variance += (mean(first + i * kBatch, first + (i + 1) * kBatch) - centre).cwiseAbs2();
  }
  variance /= static_cast<double>(batches * (batches - 1));
  const double stood_s = to_seconds(blocks_.back().t_end - blocks_.front().t_begin);
  return variance.cwiseMax(white_variance(stood_s));
}

StandingFix StandingInitialiser::solve(const BiasPrior& prior, const Vector6d& mean,
                                       const Vector6d& variance) const {
  const Matrix3d gyro_prior = prior.covariance.topLeftCorner<3, 3>().inverse();
  const Matrix3d gyro_measured = variance.head<3>().cwiseInverse().asDiagonal();
  const Matrix3d gyro_covariance = (gyro_prior + gyro_measured).inverse();
  const RestSolver rest{mean.tail<3>(), variance.tail<3>(), prior.bias.accel_mps2,
                        prior.covariance.bottomRightCorner<3, 3>()};
  StandingFix fix;
  fix.t = blocks_.back().t_end;
  fix.stood = blocks_.back().t_end - blocks_.front().t_begin;
  fix.R_odom_imu = level_rotation(rest.up(), forward_imu_);
  fix.bias.gyro_radps =
      gyro_covariance * (gyro_prior * prior.bias.gyro_radps + gyro_measured * mean.head<3>());
  fix.bias.accel_mps2 = rest.bias();
  const Matrix6d covariance = rest.covariance();
  fix.covariance.topLeftCorner<3, 3>() = covariance.topLeftCorner<3, 3>();
  fix.covariance.topRightCorner<3, 3>() = covariance.topRightCorner<3, 3>();
  fix.covariance.bottomLeftCorner<3, 3>() = covariance.bottomLeftCorner<3, 3>();
  fix.covariance.bottomRightCorner<3, 3>() = covariance.bottomRightCorner<3, 3>();
  fix.covariance.block<3, 3>(3, 3) = gyro_covariance;
  return fix;
}

Result<StandingFix> StandingInitialiser::fix() const {
  if (!standing()) {
    return fail(ErrorCode::kUnavailable, "the IMU stood still for {:.1f} s of the {:.1f} it must",
                to_seconds(kBlock) * static_cast<double>(blocks_.size()),
                to_seconds(kBlock) * static_cast<double>(kLeastBlocks));
  }
  const Vector6d average = mean(0, blocks_.size());
  const Vector6d variance = variance_of_mean();
  const double rate = average.head<3>().cwiseAbs().maxCoeff();
  if (rate > kMostGyroBias) {
    return fail(ErrorCode::kUnavailable,
                "the IMU turns at {:.2f} rad/s, more than a bias of {:.2f}", rate, kMostGyroBias);
  }
  if (contradicts(BiasPrior::cold(), average, variance)) {
    return fail(ErrorCode::kUnavailable,
                "the accelerometer shows {:.2f} m/s^2 at rest, too far from gravity's {:.2f}",
                average.tail<3>().norm(), kStandardGravity);
  }
  if (!contradicts(prior_, average, variance)) {
    return solve(prior_, average, variance);
  }
  StandingFix cold = solve(BiasPrior::cold(), average, variance);
  cold.prior_rejected = true;
  return cold;
}

}  // namespace geoflow::slam
