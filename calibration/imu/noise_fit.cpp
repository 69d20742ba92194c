#include "imu/noise_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geoflow/calibration/allan.hpp"
#include "geoflow/hal/geometry.hpp"

#include "imu/noise_model.hpp"

namespace geoflow::calibration {
namespace {

/// The longest averaging time is this part of the signal: beyond, a variance has too few
/// differences to be near Gaussian.
constexpr std::size_t kLongestPart = 8;
/// Short averaging times may be left out up to this.
constexpr double kLongestFilterS = 0.1;
constexpr int kIterations = 5;
/// Scales that the fit must keep.
constexpr std::size_t kFewestScales = 5;
constexpr Eigen::Index kPowers = 3;
/// Standard deviations of a normal distribution that 1 in 10^4 exceeds.
constexpr double kRare = 3.72;

/// Whether a chi-square value of so many degrees of freedom is rare: Wilson and Hilferty's cube
/// root.
bool rare(double chi_square, double degrees) {
  const double spread = 2 / (9 * degrees);
  return std::cbrt(chi_square / degrees) > 1 - spread + kRare * std::sqrt(spread);
}

struct Solution {
  NoisePowers powers = NoisePowers::Zero();
  double chi_square = std::numeric_limits<double>::infinity();
};

/// Least squares on whitened rows with only some of the powers (white noise always), the others
/// zero.
Solution solve_subset(const Eigen::MatrixX3d& design, const Eigen::VectorXd& values,
                      const std::array<bool, kPowers>& used) {
  Eigen::MatrixX3d columns = design;
  for (Eigen::Index i = 0; i < kPowers; ++i) {
    if (!used.at(static_cast<std::size_t>(i))) {
      columns.col(i).setZero();
    }
  }
  // Columns differ by orders of magnitude.
  Vector3d scale = columns.colwise().norm();
  Matrix3d normal = Matrix3d::Identity();
  Vector3d right = Vector3d::Zero();
  for (Eigen::Index i = 0; i < kPowers; ++i) {
    scale[i] = scale[i] > 0 ? scale[i] : 1.0;
    for (Eigen::Index j = 0; j < kPowers; ++j) {
      if (used.at(static_cast<std::size_t>(i)) && used.at(static_cast<std::size_t>(j))) {
        normal(i, j) = columns.col(i).dot(columns.col(j)) / (scale[i] * scale[j]);
      }
    }
    right[i] = columns.col(i).dot(values) / scale[i];
  }
  Solution solution;
  solution.powers = normal.ldlt().solve(right).cwiseQuotient(scale);
  solution.chi_square = (values - columns * solution.powers).squaredNorm();
  return solution;
}

/// The best solution without a negative power.
Solution solve(const Eigen::MatrixX3d& design, const Eigen::VectorXd& values) {
  Solution best;
  for (const bool flicker : {false, true}) {
    for (const bool walk : {false, true}) {
      const Solution candidate = solve_subset(design, values, {true, flicker, walk});
      if (candidate.powers.minCoeff() >= 0 && candidate.chi_square < best.chi_square) {
        best = candidate;
      }
    }
  }
  return best;
}

/// The Allan variances to fit, at ascending factors.
struct Variances {
  std::vector<std::size_t> factors;
  Eigen::VectorXd values;
};

NoiseFit fit_scales(const Variances& variances, std::size_t count, double period_s) {
  const Eigen::MatrixX3d design = allan_design(variances.factors, period_s);
  // To begin with: independent, each with the degrees of freedom of separate windows.
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(design.rows(), design.rows());
  for (Eigen::Index i = 0; i < design.rows(); ++i) {
    const auto factor = static_cast<double>(variances.factors[static_cast<std::size_t>(i)]);
    covariance(i, i) = 2 * factor / static_cast<double>(count) * std::pow(variances.values[i], 2);
  }
  NoiseFit fit;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::LLT<Eigen::MatrixXd> root{covariance};
    const Eigen::MatrixX3d white_design = root.matrixL().solve(design);
    const Solution solution = solve(white_design, root.matrixL().solve(variances.values));
    const Vector3d scale = white_design.colwise().norm().cwiseInverse();
    const Eigen::MatrixX3d scaled = white_design * scale.asDiagonal();
    const Matrix3d inverse = (scaled.transpose() * scaled).inverse();
    fit = {.powers = solution.powers,
           .covariance = scale.asDiagonal() * inverse * scale.asDiagonal(),
           .shortest = variances.factors.front(),
           .misfit = solution.chi_square / static_cast<double>(design.rows() - kPowers)};
    covariance = allan_covariance(fit.powers, variances.factors, count, period_s);
  }
  return fit;
}

}  // namespace

NoiseFit fit_noise(std::span<const double> signal, double period_s) {
  const auto factors = allan_factors(signal.size() / kLongestPart, 1);
  const auto points = overlapping_allan(signal, period_s, factors);
  NoiseFit fit;
  for (std::size_t first = 0; first + kFewestScales <= points.size(); ++first) {
    if (first > 0 && points[first].tau_s > kLongestFilterS) {
      break;
    }
    Variances variances{
        .factors = {factors.begin() + static_cast<std::ptrdiff_t>(first), factors.end()},
        .values = Eigen::VectorXd(static_cast<Eigen::Index>(points.size() - first))};
    for (std::size_t i = first; i < points.size(); ++i) {
      variances.values[static_cast<Eigen::Index>(i - first)] = points[i].variance;
    }
    const NoiseFit candidate = fit_scales(variances, signal.size(), period_s);
    const auto degrees = static_cast<double>(points.size() - first) - double(kPowers);
    const bool fits = !rare(candidate.misfit * degrees, degrees);
    if (first == 0 || fits) {
      fit = candidate;
    }
    if (fits) {
      break;
    }
  }
  fit.covariance *= std::max(1.0, fit.misfit);
  return fit;
}

}  // namespace geoflow::calibration
