#include "odometry/pose_optimiser.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "geoflow/hal/geometry.hpp"

#include "cloud/gicp.hpp"
#include "optimisation/agreement.hpp"
#include "optimisation/matrix6.hpp"

namespace geoflow::slam {
namespace {

constexpr double kMinimumDepthM = 0.05;  ///< nearer points project wildly
constexpr double kCauchyWidth = 2.0;     ///< in standard deviations

/// Weight of a residual of `chi2` squared standard deviations under the Cauchy kernel.
double cauchy_weight(double chi2) {
  return 1 / (1 + chi2 / (kCauchyWidth * kCauchyWidth));
}

/// d(T^-1 p)/d(xi) for T * exp(xi), rotation first: with q = T^-1 p, [ skew(q), -I ].
Eigen::Matrix<double, 3, 6> camera_point_jacobian(const Vector3d& q) {
  Eigen::Matrix<double, 3, 6> J;
  J << skew(q), -Matrix3d::Identity();
  return J;
}

}  // namespace

bool PoseSolution::seen_whole() const {
  constexpr double kToldTo = 0.1;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver{sight, Eigen::EigenvaluesOnly};
  return solver.info() == Eigen::Success && solver.eigenvalues()[0] > 1 / (kToldTo * kToldTo);
}

struct PoseOptimiser::System {
  Matrix6d H = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  std::uint32_t depth_inliers = 0;
};

std::vector<bool> PoseOptimiser::expected(std::span<const VisualMatch> matches,
                                          const PosePrior& belief) const {
  constexpr double kChi2Of2At999Permille = 13.8;
  // Not the least noise of a feature: what a calibration leaves in all of them must pass.
  constexpr double kGatePx = 1;
  const SE3 T_cam_odom = belief.T_odom_cam.inverse();
  const Matrix6d P = inverse(belief.information);
  std::vector<bool> allowed(matches.size(), false);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Vector3d p_cam = T_cam_odom * matches[i].p_odom;
    if (p_cam.z() < kMinimumDepthM) {
      continue;
    }
    const Eigen::Matrix<double, 2, 6> J =
        camera_.project_jacobian(p_cam) * camera_point_jacobian(p_cam);
    const Eigen::Matrix2d S =
        J * P * J.transpose() + kGatePx * kGatePx * Eigen::Matrix2d::Identity();
    const Vector2d r = camera_.project(p_cam) - matches[i].pixel;
    allowed[i] = r.dot(S.ldlt().solve(r)) < kChi2Of2At999Permille;
  }
  return allowed;
}

double PoseOptimiser::pixel_sigma(const PoseProblem& problem, const SE3& T_odom_cam) const {
  constexpr double kMedianOfRayleigh = 1.17741;  // median of |r| of a 2-D Gaussian with sigma 1
  std::vector<double> residuals;
  const SE3 T_cam_odom = T_odom_cam.inverse();
  for (const VisualMatch& match : problem.matches) {
    const Vector3d p_cam = T_cam_odom * match.p_odom;
    if (p_cam.z() > kMinimumDepthM) {
      residuals.push_back((camera_.project(p_cam) - match.pixel).norm());
    }
  }
  if (residuals.empty()) {
    return config_.pixel_sigma;
  }
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  return std::max(config_.pixel_sigma, *middle / kMedianOfRayleigh);
}

void PoseOptimiser::add_visual(const PoseProblem& problem, const SE3& T_odom_cam, double sigma_px,
                               System& system) const {
  const SE3 T_cam_odom = T_odom_cam.inverse();
  for (const VisualMatch& match : problem.matches) {
    const Vector3d p_cam = T_cam_odom * match.p_odom;
    if (p_cam.z() < kMinimumDepthM) {
      continue;
    }
    const Eigen::Matrix<double, 3, 6> J_point = camera_point_jacobian(p_cam);
    const Vector2d r = (camera_.project(p_cam) - match.pixel) / sigma_px;
    const Eigen::Matrix<double, 2, 6> J = camera_.project_jacobian(p_cam) * J_point / sigma_px;
    const double weight = cauchy_weight(r.squaredNorm());
    system.H += weight * J.transpose() * J;
    system.gradient += weight * J.transpose() * r;
    if (match.depth_m > 0) {
      const double sigma = mapping_.inverse_depth_sigma;
      const double rz = (1 / p_cam.z() - 1 / match.depth_m) / sigma;
      const Eigen::Matrix<double, 1, 6> J_z = J_point.row(2) / (-p_cam.z() * p_cam.z() * sigma);
      const double weight_z = weight * cauchy_weight(rz * rz);
      system.H += weight_z * J_z.transpose() * J_z;
      system.gradient += weight_z * J_z.transpose() * rz;
    }
  }
}

DepthInformation PoseOptimiser::depth_system(const PoseProblem& problem,
                                             std::span<const SurfelSample> sample,
                                             const SE3& T_odom_cam, std::uint32_t& inliers) const {
  NormalEquations sum;
  for (const DepthTarget& target : problem.targets) {
    // A right perturbation of T_target_cam is one of T_odom_cam, so the systems simply add.
    const SE3 T_target_cam = target.T_odom_target.inverse() * T_odom_cam;
    const NormalEquations equations =
        linearise(*problem.cloud, sample, *target.cloud, T_target_cam, gicp_);
    inliers = std::max(inliers, static_cast<std::uint32_t>(equations.inliers));
    sum += equations;
  }
  if (sum.inliers == 0) {
    return {};
  }
  // The targets see the same surfaces, with the same errors: together they count as one.
  const double share = 1.0 / static_cast<double>(problem.targets.size());
  const DepthInformation depth = constrained(sum, gicp_);
  return {.H = share * depth.H, .b = share * depth.b};
}

Matrix6d PoseOptimiser::agreed_by(const PosePrior& belief, const DepthInformation& depth,
                                  const SE3& T_odom_cam) {
  const Vector6d from_belief = (belief.T_odom_cam.inverse() * T_odom_cam).log();
  return agreeing(depth.H, depth.b - depth.H * from_belief, inverse(belief.information));
}

void PoseOptimiser::classify(std::span<const VisualMatch> matches, const std::vector<bool>& allowed,
                             PoseSolution& solution) const {
  constexpr double kChi2Of2At95Percent = 5.991;
  const SE3 T_cam_odom = solution.T_odom_cam.inverse();
  const double variance = solution.pixel_sigma * solution.pixel_sigma;
  solution.inlier.assign(matches.size(), false);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Vector3d p_cam = T_cam_odom * matches[i].p_odom;
    if (!allowed[i] || p_cam.z() < kMinimumDepthM) {
      continue;
    }
    const double chi2 = (camera_.project(p_cam) - matches[i].pixel).squaredNorm() / variance;
    if (chi2 < kChi2Of2At95Percent) {
      solution.inlier[i] = true;
      ++solution.visual_inliers;
    }
  }
}

PoseSolution PoseOptimiser::solve(const PoseProblem& whole, const SE3& start) const {
  constexpr double kConverged = 1e-5;  // [rad], [m]
  PoseSolution solution;
  const std::vector<bool> allowed = whole.reckoned ? expected(whole.matches, *whole.reckoned)
                                                   : std::vector<bool>(whole.matches.size(), true);
  std::vector<VisualMatch> gated;
  for (std::size_t i = 0; i < allowed.size(); ++i) {
    if (allowed[i]) {
      gated.push_back(whole.matches[i]);
    }
  }
  PoseProblem problem = whole;
  problem.matches = gated;
  solution.T_odom_cam = start;
  std::vector<SurfelSample> sample;
  if (problem.cloud != nullptr && !problem.targets.empty()) {
    sample = select(*problem.cloud, static_cast<std::size_t>(config_.gicp_surfels));
    solution.depth_surfels = static_cast<std::uint32_t>(sample.size());
  }
  Matrix6d agreed = Matrix6d::Identity();
  for (int i = 0; i < config_.iterations; ++i) {
    System system;
    solution.pixel_sigma = pixel_sigma(problem, solution.T_odom_cam);
    add_visual(problem, solution.T_odom_cam, solution.pixel_sigma, system);
    const DepthInformation depth =
        depth_system(problem, sample, solution.T_odom_cam, system.depth_inliers);
    if (i == 0 && problem.reckoned) {
      agreed = agreed_by(*problem.reckoned, depth, solution.T_odom_cam);
    }
    system.H += agreed.transpose() * depth.H * agreed;
    system.gradient += agreed.transpose() * depth.b;
    const Vector6d from_prior = (problem.prior.T_odom_cam.inverse() * solution.T_odom_cam).log();
    system.gradient += problem.prior.information * from_prior;
    const Eigen::LDLT<Matrix6d> H{system.H + problem.prior.information};
    solution.covariance = H.solve(Matrix6d::Identity());
    solution.sight = system.H;
    solution.depth_inliers = system.depth_inliers;
    const Vector6d step = -H.solve(system.gradient);
    if (!step.allFinite()) {
      break;
    }
    solution.T_odom_cam = solution.T_odom_cam * SE3::exp(step);
    if (step.norm() < kConverged) {
      break;
    }
  }
  classify(whole.matches, allowed, solution);
  return solution;
}

}  // namespace geoflow::slam
