#include "inertial/preintegration.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <ratio>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

namespace geoflow::slam {
namespace {

/// Longest time without a sample that is bridged: a quarter of a trotting robot's stride.
constexpr Duration kLongestGap = std::chrono::milliseconds{100};
/// A step that is longer than this many of the sensor's periods is a gap.
constexpr double kGapPeriods = 1.5;

/// How fast a walking robot's signals wander: root mean square of steps over 5 to 40 ms, divided by
/// the root of the time. Measured on a Go1 trotting (per axis): 11 to 12.4, and 0.9 to 1.3.
constexpr double kAccelWander = 12.0;  // [m/s^2/sqrt(s)]
constexpr double kGyroWander = 1.3;    // [rad/s/sqrt(s)]

/// Steps within this many standard deviations of the sensor's own noise say nothing of the signal.
constexpr double kNoiseSigmas = 3.0;

/// Variance of a Brownian bridge's mean over unit time and volatility (both ends known), and of a
/// Brownian motion's (one end known).
constexpr double kBridge = 1.0 / 12;
constexpr double kOneEnd = 1.0 / 3;
/// Second Magnus term of a rotation whose rate is linear in time; weights of the double integral of
/// a linear function.
constexpr double kMagnus = 1.0 / 12;
constexpr double kFirstWeight = 1.0 / 3;
constexpr double kSecondWeight = 1.0 / 6;

using StepJacobian = Eigen::Matrix<double, kMotionSize, kMotionSize>;
using Inputs = Eigen::Matrix<double, kBiasSize, 1>;

/// One stretch between two instants at which the sample is known or interpolated.
struct Step {
  InertialSample first;
  InertialSample last;
  double dt_s = 0;
  double gap_s = 0;   ///< between the samples that it was interpolated from
  bool held = false;  ///< one of them is missing
};

InertialSample interpolate(const InertialSample& a, const InertialSample& b, HostTime t) {
  const double ratio = to_seconds(t - a.t) / to_seconds(b.t - a.t);
  const auto mix = [ratio](const auto& x, const auto& y) { return x + ratio * (y - x); };
  return {.t = t,
          .sample = {.accel_mps2 = mix(a.sample.accel_mps2, b.sample.accel_mps2),
                     .gyro_radps = mix(a.sample.gyro_radps, b.sample.gyro_radps)},
          .gyro_variance_radps2 = mix(a.gyro_variance_radps2, b.gyro_variance_radps2),
          .accel_variance_m2ps4 = mix(a.accel_variance_m2ps4, b.accel_variance_m2ps4)};
}

/// Variance of a step's mean that comes from the signal between the samples, per axis.
Vector3d unseen_variance(const Vector3d& change, double noise_sigma, double wander,
                         const Step& step, double period_s) {
  const double least = kNoiseSigmas * std::numbers::sqrt2 * noise_sigma;
  Vector3d variance = kBridge * (change.cwiseAbs().array() - least).cwiseMax(0).square().matrix();
  if (step.held || step.gap_s > kGapPeriods * period_s) {
    const double share = (step.held ? kOneEnd : kBridge) * step.gap_s;
    variance = variance.cwiseMax(Vector3d::Constant(share * wander * wander));
  }
  return variance;
}

class Integrator {
 public:
  Integrator(const ImuBias& bias, const ImuNoise& noise, double period_s)
      : noise_{noise}, period_s_{period_s} {
    result_.bias = bias;
  }

  void add(const Step& step) {
    const double dt = step.dt_s;
    const Vector3d w0 = step.first.sample.gyro_radps - result_.bias.gyro_radps;
    const Vector3d w1 = step.last.sample.gyro_radps - result_.bias.gyro_radps;
    const Vector3d f0 = step.first.sample.accel_mps2 - result_.bias.accel_mps2;
    const Vector3d f1 = step.last.sample.accel_mps2 - result_.bias.accel_mps2;

    const Vector3d phi = dt * (0.5 * (w0 + w1) + kMagnus * dt * w0.cross(w1));
    const Eigen::Quaterniond turn = so3::exp(phi);
    const Matrix3d R0 = result_.R_imu0_imu1.toRotationMatrix();
    result_.R_imu0_imu1 = (result_.R_imu0_imu1 * turn).normalized();
    const Matrix3d R1 = result_.R_imu0_imu1.toRotationMatrix();
    const double weight0 = kFirstWeight * dt * dt;
    const double weight1 = kSecondWeight * dt * dt;
    result_.dp += dt * result_.dv + weight0 * (R0 * f0) + weight1 * (R1 * f1);
    result_.dv += 0.5 * dt * (R0 * f0 + R1 * f1);
    result_.dt_s += dt;

    // Derivatives of the lines above by the state before the step, and by the biases.
    const Matrix3d by_gyro = so3::right_jacobian(phi) * dt *
                             (kMagnus * dt * (skew(w1) - skew(w0)) - Matrix3d::Identity());
    const Matrix3d back = turn.toRotationMatrix().transpose();
    const Matrix3d G0 = -R0 * skew(f0);
    const Matrix3d G1 = -R1 * skew(f1);
    StepJacobian F = StepJacobian::Identity();
    F.block<3, 3>(kRotationAt, kRotationAt) = back;
    F.block<3, 3>(kTranslationAt, kRotationAt) = weight0 * G0 + weight1 * G1 * back;
    F.block<3, 3>(kTranslationAt, kVelocityAt) = dt * Matrix3d::Identity();
    F.block<3, 3>(kVelocityAt, kRotationAt) = 0.5 * dt * (G0 + G1 * back);
    Preintegrated::BiasJacobian B;
    B << by_gyro, Matrix3d::Zero(),                            //
        weight1 * G1 * by_gyro, -weight0 * R0 - weight1 * R1,  //
        0.5 * dt * G1 * by_gyro, -0.5 * dt * (R0 + R1);
    result_.by_bias = F * result_.by_bias + B;
    propagate(F, B, input_variance(step), dt);
  }

  [[nodiscard]] Preintegrated finish(HostTime t_begin, HostTime t_end, Duration longest_gap) {
    result_.t_begin = t_begin;
    result_.t_end = t_end;
    result_.longest_gap = longest_gap;
    return result_;
  }

 private:
  /// Variance of the step's mean of (gyro, accel).
  [[nodiscard]] Inputs input_variance(const Step& step) const {
    const auto axis = [&](const Vector3d& change, double density, double wander, double screened) {
      const double white = density * density / step.dt_s;
      // Each sample belongs to two steps; what the screen adds is counted as often as white noise.
      const double added = screened * period_s_ / step.dt_s;
      const double sigma = density / std::sqrt(period_s_);
      return Vector3d{unseen_variance(change, sigma, wander, step, period_s_) +
                      Vector3d::Constant(white + added)};
    };
    const InertialSample& a = step.first;
    const InertialSample& b = step.last;
    Inputs variance;
    variance << axis(b.sample.gyro_radps - a.sample.gyro_radps, noise_.gyro_noise_density,
                     kGyroWander, 0.5 * (a.gyro_variance_radps2 + b.gyro_variance_radps2)),
        axis(b.sample.accel_mps2 - a.sample.accel_mps2, noise_.accel_noise_density, kAccelWander,
             0.5 * (a.accel_variance_m2ps4 + b.accel_variance_m2ps4));
    return variance;
  }

  void propagate(const StepJacobian& F, const Preintegrated::BiasJacobian& B,
                 const Inputs& variance, double dt) {
    StateMatrix A = StateMatrix::Identity();
    A.topLeftCorner<kMotionSize, kMotionSize>() = F;
    A.topRightCorner<kMotionSize, kBiasSize>() = B;
    result_.covariance = A * result_.covariance * A.transpose();
    result_.covariance.topLeftCorner<kMotionSize, kMotionSize>() +=
        B * variance.asDiagonal() * B.transpose();
    const double gyro_walk = noise_.gyro_random_walk * noise_.gyro_random_walk * dt;
    const double accel_walk = noise_.accel_random_walk * noise_.accel_random_walk * dt;
    result_.covariance.diagonal().segment<3>(kGyroBiasAt).array() += gyro_walk;
    result_.covariance.diagonal().segment<3>(kAccelBiasAt).array() += accel_walk;
  }

  ImuNoise noise_;
  double period_s_;
  Preintegrated result_;
};

/// The sensor's period, or the median one of the samples where they come more slowly than it says.
double period_of(std::span<const InertialSample> samples, const ImuNoise& noise) {
  std::vector<Duration> periods;
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    periods.push_back(samples[i + 1].t - samples[i].t);
  }
  if (periods.empty()) {
    return 1 / noise.rate_hz;
  }
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return std::max(1 / noise.rate_hz, to_seconds(*middle));
}

/// The step from `a` to `b`, cut to [t_begin, t_end].
Step cut(const InertialSample& a, const InertialSample& b, HostTime t_begin, HostTime t_end) {
  Step step{.first = a, .last = b, .dt_s = 0, .gap_s = to_seconds(b.t - a.t), .held = false};
  if (a.t < t_begin) {
    step.first = interpolate(a, b, t_begin);
  }
  if (b.t > t_end) {
    step.last = interpolate(a, b, t_end);
  }
  step.dt_s = to_seconds(step.last.t - step.first.t);
  return step;
}

Step hold(const InertialSample& sample, HostTime t_begin, HostTime t_end) {
  Step step{.first = sample, .last = sample, .dt_s = 0, .gap_s = 0, .held = true};
  step.first.t = t_begin;
  step.last.t = t_end;
  step.dt_s = step.gap_s = to_seconds(t_end - t_begin);
  return step;
}

/// The steps that cover [t_begin, t_end].
std::vector<Step> steps_over(std::span<const InertialSample> samples, HostTime t_begin,
                             HostTime t_end) {
  std::vector<Step> steps;
  steps.reserve(samples.size() + 1);
  if (samples.front().t > t_begin) {
    steps.push_back(hold(samples.front(), t_begin, std::min(samples.front().t, t_end)));
  }
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    const InertialSample& a = samples[i];
    const InertialSample& b = samples[i + 1];
    if (b.t > t_begin && a.t < t_end && b.t > a.t) {
      steps.push_back(cut(a, b, t_begin, t_end));
    }
  }
  if (samples.back().t < t_end) {
    steps.push_back(hold(samples.back(), std::max(samples.back().t, t_begin), t_end));
  }
  return steps;
}

}  // namespace

std::vector<InertialSample> unscreened(std::span<const Timed<ImuSample>> samples) {
  std::vector<InertialSample> result;
  result.reserve(samples.size());
  std::ranges::transform(samples, std::back_inserter(result), [](const Timed<ImuSample>& timed) {
    return InertialSample{.t = timed.t, .sample = timed.sample};
  });
  return result;
}

Preintegrated::Increments Preintegrated::at(const ImuBias& other) const {
  const Eigen::Matrix<double, kMotionSize, 1> change = by_bias * (other.vector() - bias.vector());
  return {.R_imu0_imu1 = R_imu0_imu1 * so3::exp(change.segment<3>(kRotationAt)),
          .dp = dp + change.segment<3>(kTranslationAt),
          .dv = dv + change.segment<3>(kVelocityAt)};
}

Result<Preintegrated> preintegrate(std::span<const InertialSample> samples, HostTime t_begin,
                                   HostTime t_end, const ImuBias& bias, const ImuNoise& noise) {
  if (samples.empty()) {
    return fail(ErrorCode::kUnavailable, "no IMU samples to integrate");
  }
  if (t_end <= t_begin) {
    return fail(ErrorCode::kUnavailable, "an empty interval to integrate IMU samples over");
  }
  double longest_gap_s = 0;
  const std::vector<Step> steps = steps_over(samples, t_begin, t_end);
  for (const Step& step : steps) {
    longest_gap_s = std::max(longest_gap_s, step.gap_s);
  }
  if (longest_gap_s > to_seconds(kLongestGap)) {
    return fail(ErrorCode::kUnavailable, "{:.0f} ms without an IMU sample, at most {:.0f} bridged",
                longest_gap_s * std::milli::den, to_seconds(kLongestGap) * std::milli::den);
  }
  Integrator integrator{bias, noise, period_of(samples, noise)};
  for (const Step& step : steps) {
    integrator.add(step);
  }
  return integrator.finish(t_begin, t_end, from_seconds(longest_gap_s));
}

}  // namespace geoflow::slam
