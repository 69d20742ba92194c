#include "map/point_search.hpp"

#include <cmath>
#include <cstddef>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/overlap.hpp"
#include "odometry/frame.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {
namespace {

/// Points of keyframes that share less of the frame's depth are rarely in view.
constexpr double kSharedView = 0.4;
/// Relative difference within which a point found again is the same.
constexpr double kConsistentDepth = 0.05;

struct Candidates {
  std::vector<PointId> ids;
  std::vector<double> depths_m;
  std::vector<ExpectedFeature> expected;
};

/// Points that should be in view.
Candidates candidates(const Map& map, const Frame& frame, const CameraModel& camera) {
  Candidates found;
  std::set<PointId> present;
  for (const Feature& feature : frame.features) {
    if (feature.point) {
      present.insert(*feature.point);
    }
  }
  const SE3 T_cam_odom = frame.T_odom_cam.inverse();
  for (const auto& [keyframe, share] :
       overlapping_keyframes(map, *frame.cloud, frame.T_odom_cam, kSharedView)) {
    for (const PointId id : map.keyframe(keyframe).points) {
      const MapPoint& point = *map.find_point(id);
      const Vector3d p_cam = T_cam_odom * point.p_odom;
      if (p_cam.z() <= 0 || !present.insert(id).second) {
        continue;
      }
      const Vector2d raw = camera.distort(camera.project(p_cam));
      if (camera.contains(raw, 0)) {
        found.ids.push_back(id);
        found.depths_m.push_back(p_cam.z());
        found.expected.push_back({raw, point.descriptor});
      }
    }
  }
  return found;
}

}  // namespace

std::vector<std::optional<PointId>> find_points(const Map& map, const Frame& frame,
                                                std::span<const Feature> features, double radius_px,
                                                const CameraModel& camera) {
  std::vector<std::optional<PointId>> points(features.size());
  if (!frame.cloud) {
    return points;
  }
  const Candidates wanted = candidates(map, frame, camera);
  std::vector<OrbFeature> described;
  described.reserve(features.size());
  for (const Feature& feature : features) {
    described.push_back({feature.raw, feature.descriptor});
  }
  const std::vector<int> match = match_by_projection(wanted.expected, described, radius_px);
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] < 0) {
      continue;
    }
    const auto j = static_cast<std::size_t>(match[i]);
    const double expected_m = wanted.depths_m[i];
    if (std::abs(features[j].depth_m - expected_m) < kConsistentDepth * expected_m) {
      points[j] = wanted.ids[i];
    }
  }
  return points;
}

}  // namespace geoflow::slam
