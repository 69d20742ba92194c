#include "vision/pnp.hpp"

#include <optional>
#include <span>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "odometry/pose_optimiser.hpp"
#include "vision/camera_model.hpp"

namespace geoflow::slam {

std::optional<PnpSolution> solve_pnp(std::span<const VisualMatch> matches,
                                     const CameraModel& camera, const PoseConfig& config,
                                     const PnpEffort& effort) {
  constexpr double kConfidence = 0.99;
  if (matches.size() < effort.least_inliers) {
    return std::nullopt;
  }
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const VisualMatch& match : matches) {
    points.emplace_back(match.p_odom.x(), match.p_odom.y(), match.p_odom.z());
    pixels.emplace_back(match.pixel.x(), match.pixel.y());
  }
  const CameraIntrinsics& k = camera.intrinsics();
  const cv::Matx33d K{k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
  cv::Vec3d rotation;
  cv::Vec3d translation;
  std::vector<int> inliers;
  const bool found = cv::solvePnPRansac(
      points, pixels, K, cv::noArray(), rotation, translation, false, effort.iterations,
      static_cast<float>(config.pnp_threshold_px), kConfidence, inliers, cv::SOLVEPNP_P3P);
  const auto count = static_cast<double>(inliers.size());
  if (!found || inliers.size() < effort.least_inliers ||
      count < effort.least_inlier_share * static_cast<double>(matches.size())) {
    return std::nullopt;
  }
  const SE3 T_cam_odom{so3::exp({rotation[0], rotation[1], rotation[2]}),
                       {translation[0], translation[1], translation[2]}};
  if (!T_cam_odom.matrix().allFinite()) {
    return std::nullopt;
  }
  return PnpSolution{.T_odom_cam = T_cam_odom.inverse(), .inliers = inliers.size()};
}

}  // namespace geoflow::slam
