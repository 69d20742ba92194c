#pragma once

#include <optional>
#include <span>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "odometry/pose_optimiser.hpp"
#include "vision/camera_model.hpp"

namespace geoflow::slam {

/// Pose by PnP with RANSAC over map points (paper, section IV-B): P3P hypotheses, refined on their
/// inliers. None when fewer than PoseConfig::minimum_visual_inliers or less than half of the
/// matches agree. Deterministic.
[[nodiscard]] std::optional<SE3> solve_pnp(std::span<const VisualMatch> matches,
                                           const CameraModel& camera, const PoseConfig& config);

}  // namespace geoflow::slam
