#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"

/// Generalised ICP (Segal, Haehnel, Thrun, RSS 2009) on organised surfels, with projective
/// association.
///
/// In short, for the caller:
///   1. one CellGrid a camera; one DepthCloud a frame, `cloud.build(frame)`;
///   2. `register_clouds(source, target, guess, config)`: pose, honest information, open
///   directions;
///   3. or `linearise(source, target, T, config)`: one Gauss-Newton system to add to other
///   residuals, for any number of
///      targets; `select(source, n)` once a frame thins the source to about n well-chosen surfels
///      for that.
/// The tangent is the right perturbation of T_target_source, rotation first (hal/geometry.hpp).
///
/// Each surfel's covariance is a plane: the position of a surfel within its surface is arbitrary
/// (it is where the cell happens to lie), so the residual is the distance along the pair's common
/// normal n ~ n_target + R n_source only, with variance n^T (C_target + R C_source R^T) n; GICP's
/// in-plane part would only record the image grid. All functions are pure and deterministic: the
/// same bits with any number of TBB threads.
namespace geoflow::slam {

// NOLINTBEGIN(readability-magic-numbers): each number is the value of a member that names it
/// One level of coarse-to-fine association.
struct GicpStage {
  double max_distance_m = 0.1;  ///< a pair of surfels further apart is no pair
  double misalignment_m =
      0;                 ///< standard deviation added to every residual while the pose is still off
  int search_cells = 1;  ///< cells searched on each side of the projected one
  int stride = 1;        ///< every stride-th source surfel
  int max_iterations = 10;
};

struct GicpConfig {
  std::vector<GicpStage> stages = {{.max_distance_m = 0.3,
                                    .misalignment_m = 0.03,
                                    .search_cells = 1,
                                    .stride = 4,
                                    .max_iterations = 8},
                                   {.max_distance_m = 0.1,
                                    .misalignment_m = 0.005,
                                    .search_cells = 1,
                                    .stride = 2,
                                    .max_iterations = 6},
                                   {.max_distance_m = 0.1,
                                    .misalignment_m = 0.0,
                                    .search_cells = 1,
                                    .stride = 1,
                                    .max_iterations = 8}};
  double min_normal_cosine = 0.8;  ///< of the angle between paired normals (37 degrees)
  double kernel_sigmas = 2.5;      ///< Cauchy kernel's width in standard deviations of a residual
  double rotation_epsilon_rad = 3e-5;  ///< a step below both ends a stage
  double translation_epsilon_m = 3e-5;
  std::size_t min_inliers = 100;  ///< fewer pairs: not converged
  /// Information is divided by this for what the residuals share (sensor's fixed pattern,
  /// correlated noise).
  double covariance_inflation = 18.0;
  /// A direction is open when its information is less than this many times what noise in the
  /// normals feigns.
  double min_information_ratio = 4.0;
  /// A direction is open when the pairs constrain it worse than this [m] (rotations: at 1 m).
  double max_sigma_m = 0.02;
};
// NOLINTEND(readability-magic-numbers)

/// A Gauss-Newton system H xi = -b at a pose, b the gradient of cost.
struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  /// The part of H that is expected from the noise of the normals alone: it fakes information in
  /// open directions.
  Matrix6d H_noise = Matrix6d::Zero();
  double cost = 0;              ///< half the sum of robustified squared residuals
  double squared_error = 0;     ///< weighted sum of (residual / sigma)^2
  double squared_error_m2 = 0;  ///< weighted sum of residual^2 [m^2]
  double weight = 0;            ///< sum of the kernel's weights, each at most 1
  std::size_t inliers = 0;      ///< pairs

  NormalEquations& operator+=(const NormalEquations& other);
};

/// What a system tells of the pose, to be added to other residuals' systems.
struct DepthInformation {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
};

/// A system's honest part: in directions that the surfaces constrain, without what the normals'
/// noise feigns and divided by covariance_inflation; nothing in open ones, where the rest of b is
/// noise that would pull the pose along a corridor.
[[nodiscard]] DepthInformation constrained(const NormalEquations& system, const GicpConfig& config);

/// Some of a cloud's surfels, each standing for `weight` of them.
struct SurfelSample {
  std::uint32_t cell = 0;
  float weight = 1;
};

struct RegistrationResult {
  SE3 T_target_source;
  Matrix6d information =
      Matrix6d::Zero();  ///< at the solution, right perturbation; 0 along open directions
  Vector6d eigenvalues =
      Vector6d::Zero();  ///< of the information with rotations in units of scale_m, ascending
  Matrix6d directions = Matrix6d::Identity();  ///< its eigenvectors, as columns, in those units
  double scale_m =
      1;  ///< rms distance of the inliers [m]: one unit of rotation moves them about this far
  int degenerate_directions =
      0;  ///< the first so many of the eigenvalues are open: the guess was kept there
  std::size_t inliers = 0;
  double rmse_m = 0;   ///< weighted, along the normals
  double overlap = 0;  ///< inliers / source surfels
  int iterations = 0;
  bool converged = false;
};

/// The system of all pairs at T_target_source, by the finest stage's association unless told
/// otherwise.
[[nodiscard]] NormalEquations linearise(const DepthCloud& source, const DepthCloud& target,
                                        const SE3& T_target_source, const GicpConfig& config);
/// The same over a selection of the source.
[[nodiscard]] NormalEquations linearise(const DepthCloud& source,
                                        std::span<const SurfelSample> sample,
                                        const DepthCloud& target, const SE3& T_target_source,
                                        const GicpConfig& config);

/// About `count` surfels chosen so that the pose stays as well conditioned as with all of them:
/// with probability proportional to each one's leverage J^T H^-1 J, systematically (no random
/// numbers), weighted by its inverse.
[[nodiscard]] std::vector<SurfelSample> select(const DepthCloud& cloud, std::size_t count);

/// Aligns source to target from a guess. Where the surfaces leave a direction open, the guess is
/// kept in it. Never fails: without enough overlap converged is false, the pose is the guess and
/// the information zero.
[[nodiscard]] RegistrationResult register_clouds(const DepthCloud& source, const DepthCloud& target,
                                                 const SE3& T_target_source_guess,
                                                 const GicpConfig& config);

}  // namespace geoflow::slam
