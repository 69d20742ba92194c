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
  double least_inlier_share;  ///< fewer that agree: no pose
  int iterations;             ///< RANSAC hypotheses at most
};
/// Tracks have been checked forward and backward.
inline constexpr PnpEffort kPnpOnTracks{.least_inlier_share = 0.5, .iterations = 100};
/// Matches by descriptor alone: with a share of 0.2, 1000 samples of four hold a good one with
/// probability 0.8.
inline constexpr PnpEffort kPnpOnDescriptors{.least_inlier_share = 0.2, .iterations = 1000};

/// Pose by PnP with RANSAC over map points (paper, section IV-B): P3P hypotheses, refined on their
/// inliers. None when fewer than PoseConfig::minimum_visual_inliers or than the effort's share of
/// the matches agree. Deterministic.
[[nodiscard]] std::optional<PnpSolution> solve_pnp(std::span<const VisualMatch> matches,
                                                   const CameraModel& camera,
                                                   const PoseConfig& config,
                                                   const PnpEffort& effort);

}  // namespace geoflow::slam
