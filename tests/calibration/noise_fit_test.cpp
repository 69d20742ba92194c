#include "imu/noise_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/calibration/allan.hpp"
#include "geoflow/hal/geometry.hpp"
#include "tests/support/data.hpp"

#include "imu/noise_model.hpp"
#include "noise.hpp"

namespace geoflow::calibration {
namespace {

using tests::Densities;
using tests::noise;

constexpr double kPeriodS = 0.005;

TEST(NoiseModel, CovarianceOfVariancesIsThatOfManyRuns) {
  const std::array<std::size_t, 4> factors{1, 4, 16, 64};
  constexpr std::size_t kCount = 1024;
  constexpr int kRuns = 4000;
  const Densities densities{.white = 1e-2, .random_walk = 1e-2};
  std::mt19937_64 random{geoflow::tests::test_seed(11)};
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    const auto points =
        overlapping_allan(noise(densities, kCount, kPeriodS, random), kPeriodS, factors);
    Eigen::Vector4d variances;
    for (std::size_t i = 0; i < factors.size(); ++i) {
      variances[static_cast<Eigen::Index>(i)] = points[i].variance;
    }
    sum += variances;
    squares += variances * variances.transpose();
  }
  const Eigen::Vector4d mean = sum / kRuns;
  const Eigen::Matrix4d measured = squares / kRuns - mean * mean.transpose();
  const NoisePowers powers{std::pow(densities.white, 2), 0, std::pow(densities.random_walk, 2)};
  const Eigen::MatrixXd modelled = allan_covariance(powers, factors, kCount, kPeriodS);
  const Eigen::VectorXd expected = allan_design(factors, kPeriodS) * powers;
  // A covariance of so many runs is good to some percent of the variances' geometric mean.
  for (Eigen::Index i = 0; i < 4; ++i) {
    EXPECT_NEAR(mean[i] / expected[i], 1, 0.02) << i;
    for (Eigen::Index j = 0; j < 4; ++j) {
      const double scale = std::sqrt(modelled(i, i) * modelled(j, j));
      EXPECT_NEAR(measured(i, j) / scale, modelled(i, j) / scale, 0.1) << i << ' ' << j;
    }
  }
}

/// Flicker noise of bias instability `B`, by J. Kasdin's filter of fractional order ("Discrete
/// simulation of colored noise", Proc. IEEE 1995): its two-sided spectrum is B^2 / (2 pi |f|).
std::vector<double> flicker(double instability, std::size_t count, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<double> response(count, 1);
  for (std::size_t k = 1; k < count; ++k) {
    response[k] = response[k - 1] * (static_cast<double>(k) - 0.5) / static_cast<double>(k);
  }
  std::vector<double> shocks(count);
  std::ranges::generate(shocks, [&] { return instability * normal(random); });
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k <= i; ++k) {
      values[i] += response[k] * shocks[i - k];
    }
  }
  return values;
}

TEST(NoiseFit, FindsBiasInstability) {
  constexpr std::size_t kCount = 20000;
  constexpr double kInstability = 3e-3;
  std::mt19937_64 random{geoflow::tests::test_seed(12)};
  const auto slow = flicker(kInstability, kCount, random);
  auto values = noise({.white = 2e-4}, kCount, kPeriodS, random);
  for (std::size_t i = 0; i < kCount; ++i) {
    values[i] += slow[i];
  }
  const NoiseFit fit = fit_noise(values, kPeriodS);
  const double sigma = std::sqrt(fit.covariance(1, 1));
  EXPECT_GT(fit.powers[1], 5 * sigma);
  EXPECT_NEAR(fit.powers[1], kInstability * kInstability, 3 * sigma);
  EXPECT_LT(fit.misfit, 3);
}

TEST(NoiseFit, PowersAreWithinTheirSigmas) {
  int total = 0;
  int within = 0;
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    std::mt19937_64 random{geoflow::tests::test_seed(100) + seed};
    const Densities densities{.white = 2e-3, .random_walk = seed % 2 == 0 ? 1e-3 : 0.0};
    const NoiseFit fit = fit_noise(noise(densities, 12000, kPeriodS, random), kPeriodS);
    const NoisePowers truth{std::pow(densities.white, 2), 0, std::pow(densities.random_walk, 2)};
    EXPECT_EQ(fit.shortest, 1) << seed;
    EXPECT_GE(fit.powers.minCoeff(), 0) << seed;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double error = (fit.powers[i] - truth[i]) / std::sqrt(fit.covariance(i, i));
      squares += error * error;
      within += std::abs(error) <= 3 ? 1 : 0;
      ++total;
    }
  }
  RecordProperty("mean_squared_error_in_sigmas", std::to_string(squares / total));
  EXPECT_GE(within, total * 95 / 100);
  // Powers stop at zero, which makes errors of those that are not there smaller.
  EXPECT_GT(squares / total, 0.4);
  EXPECT_LT(squares / total, 1.4);
}

TEST(NoiseFit, LeavesOutAveragingTimesThatAFilterHasSmoothed) {
  constexpr std::size_t kLength = 4;
  const Densities densities{.white = 2e-3};
  std::mt19937_64 random{geoflow::tests::test_seed(13)};
  const auto raw = noise(densities, 60000, kPeriodS, random);
  std::vector<double> smooth;
  for (std::size_t i = kLength; i <= raw.size(); ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < kLength; ++k) {
      sum += raw[i - 1 - k];
    }
    smooth.push_back(sum / kLength);
  }
  const NoiseFit fit = fit_noise(smooth, kPeriodS);
  EXPECT_GT(fit.shortest, 1);
  EXPECT_NEAR(std::sqrt(fit.powers[0]) / densities.white, 1, 0.05);
}

}  // namespace
}  // namespace geoflow::calibration
