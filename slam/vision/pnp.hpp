#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "odometry/pose_optimiser.hpp"
#include "vision/camera_model.hpp"

namespace geoflow::slam {

struct PnpSolution {
  SE3 T_odom_cam;
  std::size_t inliers = 0;
};

/// How many wrong matches PnP has to expect.
struct PnpEffort {
  std::size_t least_inliers;  ///< fewer that agree: no pose
  double least_inlier_share;  ///< or a smaller share of all
  int iterations;             ///< RANSAC hypotheses at most
};

/// Pose by PnP with RANSAC over map points (paper, section IV-B): P3P hypotheses, refined on their
/// inliers. None when too few agree. Deterministic.
[[nodiscard]] std::optional<PnpSolution> solve_pnp(std::span<const VisualMatch> matches,
                                                   const CameraModel& camera,
                                                   const PoseConfig& config,
                                                   const PnpEffort& effort);

}  // namespace geoflow::slam
