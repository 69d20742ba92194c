#include "cloud/gicp.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp_internal.hpp"
#include "optimisation/matrix6.hpp"

namespace geoflow::slam {
namespace {

/// Of a stage's misalignment_m [m, or rad at about 1 m]: a smaller step ends the stage.
constexpr double kSettledPart = 0.03;

/// H in coordinates in which rotation and translation compare: rotation in units of 1 / scale_m.
struct Spectrum {
  double scale_m = 1;
  Vector6d eigenvalues = Vector6d::Zero();     ///< ascending
  Matrix6d directions = Matrix6d::Identity();  ///< columns
  int open = 0;                                ///< the first so many are not constrained

  [[nodiscard]] Vector6d units() const {
    Vector6d s = Vector6d::Ones();
    s.head<3>().setConstant(1.0 / scale_m);
    return s;
  }
};

/// Eigen-analysis of what the pairs really tell: H less what the normals' noise feigns. A direction
/// with less than `least` is open.
Spectrum analyse(const NormalEquations& system, const GicpConfig& config, double least) {
  Spectrum spectrum;
  const double translation = system.H.bottomRightCorner<3, 3>().trace();
  const double rotation = system.H.topLeftCorner<3, 3>().trace();
  if (!(translation > 0.0) || !(rotation > 0.0)) {
    spectrum.open = 6;
    return spectrum;
  }
  spectrum.scale_m = std::sqrt(rotation / translation);
  const Vector6d units = spectrum.units();
  const Matrix6d H = units.asDiagonal() * (system.H - system.H_noise) * units.asDiagonal();
  const Matrix6d noise = units.asDiagonal() * system.H_noise * units.asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(0.5 * (H + H.transpose()));
  spectrum.eigenvalues = eigen.eigenvalues;
  spectrum.directions = eigen.directions;
  for (int i = 0; i < 6; ++i) {
    const Vector6d direction = spectrum.directions.col(i);
    const double feigned = direction.dot(noise * direction);
    if (spectrum.eigenvalues[i] < least ||
        spectrum.eigenvalues[i] < config.min_information_ratio * feigned) {
      spectrum.open = i + 1;
    }
  }
  return spectrum;
}

/// The Gauss-Newton step within the constrained directions (Zhang, Kaess, Singh, "On degeneracy of
/// optimization-based state estimation problems", ICRA 2016: solution remapping).
Vector6d solve(const NormalEquations& system, const Spectrum& spectrum) {
  const Vector6d units = spectrum.units();
  const int kept = 6 - spectrum.open;
  const Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> basis =
      units.asDiagonal() * spectrum.directions.rightCols(kept);
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6> reduced =
      basis.transpose() * system.H * basis;
  return -(basis * reduced.ldlt().solve(basis.transpose() * system.b));
}

void finish(const NormalEquations& system, const GicpConfig& config, std::size_t source_size,
            RegistrationResult& result) {
  const double least = config.covariance_inflation / (config.max_sigma_m * config.max_sigma_m);
  const Spectrum spectrum = analyse(system, config, least);
  result.inliers = system.inliers;
  result.overlap = source_size == 0
                       ? 0.0
                       : static_cast<double>(system.inliers) / static_cast<double>(source_size);
  if (system.weight > 0.0) {
    result.rmse_m = std::sqrt(system.squared_error_m2 / system.weight);
  }
  result.scale_m = spectrum.scale_m;
  result.directions = spectrum.directions;
  result.degenerate_directions = spectrum.open;
  const double freedom = system.weight - 6.0;
  const double misfit = freedom > 0.0 ? std::max(1.0, system.squared_error / freedom) : 1.0;
  result.eigenvalues = spectrum.eigenvalues / (misfit * config.covariance_inflation);
  result.eigenvalues.head(spectrum.open).setZero();
  const Vector6d to_units = spectrum.units().cwiseInverse();
  const Matrix6d scaled =
      spectrum.directions * result.eigenvalues.asDiagonal() * spectrum.directions.transpose();
  result.information = to_units.asDiagonal() * scaled * to_units.asDiagonal();
}

}  // namespace

DepthInformation constrained(const NormalEquations& system, const GicpConfig& config) {
  const Spectrum spectrum = analyse(system, config, 0.0);
  const int kept = 6 - spectrum.open;
  const Vector6d to_units = spectrum.units().cwiseInverse();
  const Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> basis =
      to_units.asDiagonal() * spectrum.directions.rightCols(kept);
  const Vector6d b = spectrum.units().asDiagonal() * system.b;
  DepthInformation result;
  result.H = basis * spectrum.eigenvalues.tail(kept).asDiagonal() * basis.transpose() /
             config.covariance_inflation;
  result.b =
      basis * (spectrum.directions.rightCols(kept).transpose() * b) / config.covariance_inflation;
  return result;
}

RegistrationResult register_clouds(const DepthCloud& source, const DepthCloud& target,
                                   const SE3& T_target_source_guess, const GicpConfig& config) {
  RegistrationResult result;
  result.T_target_source = T_target_source_guess;
  for (const GicpStage& stage : config.stages) {
    result.converged = false;
    for (int i = 0; i < stage.max_iterations; ++i) {
      const NormalEquations system =
          linearise_stage(source, target, result.T_target_source, stage, config);
      const auto stride = static_cast<std::size_t>(std::max(stage.stride, 1));
      const Spectrum spectrum = analyse(system, config, 0.0);
      if (system.inliers * stride < config.min_inliers || spectrum.open == 6) {
        return {.T_target_source = T_target_source_guess,
                .degenerate_directions = 6,
                .iterations = result.iterations};
      }
      const Vector6d step = solve(system, spectrum);
      result.T_target_source = result.T_target_source * SE3::exp(step);
      ++result.iterations;
      // A stage that tolerates a misalignment need not settle to more than a part of it.
      const double settled = kSettledPart * stage.misalignment_m;
      if (step.head<3>().norm() < std::max(config.rotation_epsilon_rad, settled) &&
          step.tail<3>().norm() < std::max(config.translation_epsilon_m, settled)) {
        result.converged = true;
        break;
      }
    }
  }
  finish(linearise(source, target, result.T_target_source, config), config, source.size(), result);
  return result;
}

std::vector<SurfelSample> select(const DepthCloud& cloud, std::size_t count) {
  std::vector<SurfelSample> sample;
  if (count == 0 || cloud.size() == 0) {
    return sample;
  }
  const auto jacobian = [&](std::uint32_t cell) {
    const Surfel& surfel = cloud.surfels()[cell];
    const Vector3d normal = surfel.normal.cast<double>();
    Vector6d row;
    row << surfel.point.cast<double>().cross(normal), normal;
    return Vector6d{row / std::sqrt(static_cast<double>(surfel.normal_variance))};
  };
  Matrix6d H = Matrix6d::Zero();
  for (const std::uint32_t cell : cloud.valid()) {
    const Vector6d row = jacobian(cell);
    H.noalias() += row * row.transpose();
  }
  constexpr double kRegularisation = 1e-9;
  H.diagonal() += Vector6d::Constant(kRegularisation * H.trace());
  const Matrix6d H_inverse = inverse(H);
  const double even = 6.0 / static_cast<double>(cloud.size());  // leverages sum to 6
  std::vector<double> importance;
  double total = 0;
  for (const std::uint32_t cell : cloud.valid()) {
    const Vector6d row = jacobian(cell);
    importance.push_back(0.5 * (row.dot(H_inverse * row) + even));
    total += importance.back();
  }
  const double spacing = total / static_cast<double>(count);
  double next = 0.5 * spacing;
  double sum = 0;
  for (std::size_t i = 0; i < importance.size(); ++i) {
    sum += importance[i];
    if (sum > next) {
      const double times = std::floor((sum - next) / spacing) + 1.0;
      sample.push_back({cloud.valid()[i], static_cast<float>(times * spacing / importance[i])});
      next += times * spacing;
    }
  }
  return sample;
}

}  // namespace geoflow::slam
