#include "imu/noise_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace geoflow::calibration {
namespace {

/// A difference of the means of neighbouring windows, by the integrated signal at their three ends.
constexpr std::array<double, 3> kWeights{-1 / std::numbers::sqrt2, std::numbers::sqrt2,
                                         -1 / std::numbers::sqrt2};
/// Lags in the length of the shorter window within which its covariance with the longer bends.
constexpr std::ptrdiff_t kFineSteps = 8;
/// And in the longer window, between bends.
constexpr std::ptrdiff_t kCoarseSteps = 16;
/// Beyond so many longer windows, only flicker is correlated, and by less than a thousandth.
constexpr std::ptrdiff_t kReach = 3;

/// The second antiderivative of the noise's autocovariance at a lag in periods, for powers in units
/// of the period; what the logarithm of another unit would add falls out of the differences.
double antiderivative(const NoisePowers& powers, double lag) {
  constexpr double kWalk = 1.0 / 12;
  const double t = std::abs(lag);
  const double flicker = t > 0 ? -t * t * std::log(t) / (2 * std::numbers::pi) : 0.0;
  return powers[0] * t / 2 + powers[1] * flicker - powers[2] * kWalk * t * t * t;
}

/// Covariance of the difference over windows of `a` samples at 0 and one over `b` at `lag`.
double cross_covariance(const NoisePowers& powers, std::ptrdiff_t a, std::ptrdiff_t b,
                        std::ptrdiff_t lag) {
  double sum = 0;
  for (std::ptrdiff_t p = 0; p < 3; ++p) {
    for (std::ptrdiff_t q = 0; q < 3; ++q) {
      sum -= kWeights.at(static_cast<std::size_t>(p)) * kWeights.at(static_cast<std::size_t>(q)) *
             antiderivative(powers, static_cast<double>(lag + q * b - p * a));
    }
  }
  return sum / (static_cast<double>(a) * static_cast<double>(b));
}

/// Lags that a sum over all is well told by: close together where an end of the longer window (b)
/// meets the shorter (a), far apart between.
std::vector<std::ptrdiff_t> lags_between(std::ptrdiff_t a, std::ptrdiff_t b) {
  const std::ptrdiff_t fine = std::max<std::ptrdiff_t>(1, a / kFineSteps);
  const std::ptrdiff_t coarse = std::max<std::ptrdiff_t>(1, b / kCoarseSteps);
  const std::ptrdiff_t low = -(2 + kReach) * b;
  const std::ptrdiff_t high = 2 * a + kReach * b;
  std::vector<std::ptrdiff_t> lags;
  for (std::ptrdiff_t lag = low; lag <= high; lag += coarse) {
    lags.push_back(lag);
  }
  for (const std::ptrdiff_t end : {std::ptrdiff_t{0}, b, 2 * b}) {
    for (std::ptrdiff_t lag = -a - end; lag <= 3 * a - end; lag += fine) {
      lags.push_back(lag);
    }
  }
  std::ranges::sort(lags);
  const auto repeated = std::ranges::unique(lags);
  lags.erase(repeated.begin(), repeated.end());
  return lags;
}

/// Of the Allan variances over windows of `a` <= `b` samples.
double variance_covariance(const NoisePowers& powers, std::ptrdiff_t a, std::ptrdiff_t b,
                           std::ptrdiff_t count) {
  const std::ptrdiff_t terms_a = count - 2 * a + 1;
  const std::ptrdiff_t terms_b = count - 2 * b + 1;
  const auto summand = [&](std::ptrdiff_t lag) {
    // Pairs of a difference over a at k and one over b at k + lag.
    const std::ptrdiff_t pairs = std::max<std::ptrdiff_t>(
        0, std::min(terms_a, terms_b - lag) - std::max<std::ptrdiff_t>(0, -lag));
    const double covariance = cross_covariance(powers, a, b, lag);
    return static_cast<double>(pairs) * covariance * covariance;
  };
  const std::vector<std::ptrdiff_t> lags = lags_between(a, b);
  double sum = 0;
  double before = summand(lags.front());
  for (std::size_t i = 1; i < lags.size(); ++i) {
    const double here = summand(lags[i]);
    sum += (before + here) / 2 * static_cast<double>(lags[i] - lags[i - 1]);
    before = here;
  }
  return 2 * sum / (static_cast<double>(terms_a) * static_cast<double>(terms_b));
}

}  // namespace

Eigen::MatrixX3d allan_design(std::span<const std::size_t> factors, double period_s) {
  Eigen::MatrixX3d design(static_cast<Eigen::Index>(factors.size()), 3);
  Eigen::Index row = 0;
  for (const std::size_t factor : factors) {
    const double tau_s = static_cast<double>(factor) * period_s;
    design.row(row++) << 1 / tau_s, 2 * std::numbers::ln2 / std::numbers::pi, tau_s / 3;
  }
  return design;
}

Eigen::MatrixXd allan_covariance(const NoisePowers& powers, std::span<const std::size_t> factors,
                                 std::size_t count, double period_s) {
  const auto size = static_cast<Eigen::Index>(factors.size());
  const NoisePowers per_period{powers[0] / period_s, powers[1], powers[2] * period_s};
  Eigen::MatrixXd covariance(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = i; j < size; ++j) {
      covariance(i, j) = covariance(j, i) = variance_covariance(
          per_period, static_cast<std::ptrdiff_t>(factors[static_cast<std::size_t>(i)]),
          static_cast<std::ptrdiff_t>(factors[static_cast<std::size_t>(j)]),
          static_cast<std::ptrdiff_t>(count));
    }
  }
  return covariance;
}

}  // namespace geoflow::calibration
