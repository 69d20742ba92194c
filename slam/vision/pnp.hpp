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

/// Pose by PnP with RANSAC over map points (paper, section IV-B): P3P hypotheses, refined on their
/// inliers. None when fewer than PoseConfig::minimum_visual_inliers or less than half of the
/// matches agree. Deterministic.
[[nodiscard]] std::optional<PnpSolution> solve_pnp(std::span<const VisualMatch> matches,
                                                   const CameraModel& camera,
                                                   const PoseConfig& config);

}  // namespace geoflow::slam
