#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "vision/camera_model.hpp"

/// Single-frame optimisation (paper, section IV-C): the pose of one camera against the map, by all
/// that says something about it at once.
namespace geoflow::slam {

/// A map point found in the frame.
struct VisualMatch {
  Vector3d p_odom;     ///< held fixed
  Vector2d pixel;      ///< ideal [px]
  double depth_m = 0;  ///< measured z [m]; 0: none
};

/// A keyframe's depth, in place.
struct DepthTarget {
  const DepthCloud* cloud = nullptr;
  SE3 T_odom_target;
};

/// A Gaussian belief about the pose: mean and information of a right perturbation.
struct PosePrior {
  SE3 T_odom_cam;
  Matrix6d information = Matrix6d::Zero();
};

struct PoseProblem {
  std::span<const VisualMatch> matches;
  const DepthCloud* cloud = nullptr;  ///< the frame's own depth; null: none
  std::span<const DepthTarget> targets;
  PosePrior prior;  ///< the prediction: decides what nothing else sees
  /// Where legs and IMU alone see the camera, from the last keyframe on: matches that contradict it
  /// are left out, and no inliers, and so is what depth says in directions in which it does. Things
  /// that move by themselves do, and mirror images: those follow the camera by so little in each
  /// frame that only the whole way tells them from what they are seen on.
  std::optional<PosePrior> reckoned{};
};

struct PoseSolution {
  SE3 T_odom_cam;
  Matrix6d covariance = Matrix6d::Zero();  ///< of a right perturbation
  /// Of what is seen alone, without the prior: a direction that nothing seen tells has none.
  Matrix6d sight = Matrix6d::Zero();
  std::vector<bool> inlier;  ///< of each visual match
  std::uint32_t visual_inliers = 0;
  std::uint32_t depth_inliers =
      0;  ///< of depth_surfels, the largest number that pairs with one target
  std::uint32_t depth_surfels = 0;  ///< of the frame that were tried
  double pixel_sigma = 0;  ///< standard deviation of the visual residuals, estimated from them [px]

  /// Whether what is seen tells the pose in all directions [rad, m]. Before a plain wall it does
  /// not, nor in a corridor without doors: there legs and IMU carry the pose, as long as they do.
  [[nodiscard]] bool seen_whole() const;
};

/// Robust Gauss-Newton from `start`. Residuals:
///   reprojection  r_v = pi(T^-1 p) - u              (equation (3)), Cauchy kernel
///   depth         r_z = 1 / [T^-1 p]_z - 1 / z      Cauchy kernel; why the inverse:
///   PointDepthFactor GICP          distribution to distribution against every target at once
///   (equation (5)) prior         log(T_prior^-1 T)
/// The visual standard deviation is estimated from the residuals themselves in every step (median),
/// never below PoseConfig::pixel_sigma: a camera whose colour does not fit its depth thereby yields
/// to the depth, without a switch.
///
/// The covariance is the inverse of the sum of what each says; of the depth that is only what
/// constrained() leaves.
class PoseOptimiser {
 public:
  PoseOptimiser(const PoseConfig& config, const MappingConfig& mapping, const GicpConfig& gicp,
                const CameraModel& camera)
      : config_{config}, mapping_{mapping}, gicp_{gicp}, camera_{camera} {}

  [[nodiscard]] PoseSolution solve(const PoseProblem& problem, const SE3& start) const;

 private:
  struct System;
  /// For each match whether a belief allows it, by chi-squared at 99.9 %.
  [[nodiscard]] std::vector<bool> expected(std::span<const VisualMatch> matches,
                                           const PosePrior& belief) const;
  [[nodiscard]] double pixel_sigma(const PoseProblem& problem, const SE3& T_odom_cam) const;
  void add_visual(const PoseProblem& problem, const SE3& T_odom_cam, double sigma_px,
                  System& system) const;
  /// What the depth says at T_odom_cam; `inliers`: see PoseSolution::depth_inliers.
  [[nodiscard]] DepthInformation depth_system(const PoseProblem& problem,
                                              std::span<const SurfelSample> sample,
                                              const SE3& T_odom_cam, std::uint32_t& inliers) const;
  /// agreeing() of the depth at T_odom_cam, near the belief's mean.
  [[nodiscard]] static Matrix6d agreed_by(const PosePrior& belief, const DepthInformation& depth,
                                          const SE3& T_odom_cam);
  /// Which matches fit the solution, of those that are allowed.
  void classify(std::span<const VisualMatch> matches, const std::vector<bool>& allowed,
                PoseSolution& solution) const;

  PoseConfig config_;
  MappingConfig mapping_;
  GicpConfig gicp_;
  CameraModel camera_;
};

}  // namespace geoflow::slam
