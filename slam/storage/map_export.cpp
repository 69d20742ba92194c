#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/saved_map.hpp"

#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "storage/stored_map.hpp"

namespace geoflow::slam {
namespace {

using Cube = std::array<std::int64_t, 3>;

Cube cube_of(const Vector3d& p_map, double cell_m) {
  Cube cube{};
  for (std::size_t i = 0; i < cube.size(); ++i) {
    cube.at(i) =
        static_cast<std::int64_t>(std::floor(p_map[static_cast<Eigen::Index>(i)] / cell_m));
  }
  return cube;
}

Result<std::shared_ptr<const DepthCloud>> depth_of(const Keyframe& keyframe) {
  if (keyframe.cloud || !keyframe.stored_cloud) {
    return keyframe.cloud;
  }
  return keyframe.stored_cloud->read();
}

}  // namespace

MapSummary summary(const StoredMap& map) {
  const MapContents& contents = map.contents;
  MapSummary summary{.made_by = map.identity.made_by,
                     .calibration = map.identity.calibration,
                     .keyframes = contents.keyframes.size(),
                     .points = contents.points.size(),
                     .edges = contents.edges.size() + contents.joins.size()};
  std::set<PartId> parts;
  for (const auto& [id, keyframe] : contents.keyframes) {
    parts.insert(keyframe.part);
    summary.with_depth += keyframe.cloud || keyframe.stored_cloud ? 1U : 0U;
  }
  summary.parts = parts.size();
  return summary;
}

Trajectory keyframe_poses(const StoredMap& map) {
  const SE3 T_cam_base = map.identity.calibration.T_base_cam.value_or(SE3{}).inverse();
  Trajectory poses;
  for (const auto& [id, keyframe] : map.contents.keyframes) {
    poses.push_back({keyframe.t, keyframe.T_odom_cam * T_cam_base});
  }
  return poses;
}

std::vector<MapLoop> loops(const StoredMap& map) {
  const SE3 T_cam_base = map.identity.calibration.T_base_cam.value_or(SE3{}).inverse();
  const auto p_map_base = [&](KeyframeId id) -> Vector3d {
    return (map.contents.keyframes.at(id).T_odom_cam * T_cam_base).translation();
  };
  std::vector<MapLoop> found;
  for (const RelativeEdge& edge : map.contents.edges) {
    if (edge.kind == EdgeKind::kLoop) {
      found.push_back({.p_map_from = p_map_base(edge.from), .p_map_to = p_map_base(edge.to)});
    }
  }
  return found;
}

std::vector<Vector3d> sparse_points(const StoredMap& map) {
  std::vector<Vector3d> points;
  points.reserve(map.contents.points.size());
  for (const auto& [id, point] : map.contents.points) {
    points.push_back(point.p_odom);
  }
  return points;
}

Result<std::vector<MapSurfel>> planes(const StoredMap& map, double cell_m) {
  if (!(cell_m > 0)) {
    return fail(ErrorCode::kInvalidArgument, "planes of a map: {} m is no size", cell_m);
  }
  std::map<Cube, MapSurfel> best;
  for (const auto& [id, keyframe] : map.contents.keyframes) {
    const auto cloud = depth_of(keyframe);
    if (!cloud) {
      return tl::unexpected{cloud.error()};
    }
    if (!*cloud) {
      continue;
    }
    const SE3& T_map_cam = keyframe.T_odom_cam;  // frames: the estimator's odom is the map
    for (const std::uint32_t cell : (*cloud)->valid()) {
      const Surfel& surfel = (*cloud)->surfels()[cell];
      const Vector3d p_map = T_map_cam * surfel.point.cast<double>();  // frames: of the camera
      const MapSurfel seen{.p_map = p_map,
                           .normal_map = T_map_cam.rotation() * surfel.normal.cast<double>(),
                           .sigma_m = std::sqrt(static_cast<double>(surfel.normal_variance))};
      MapSurfel& kept = best.emplace(cube_of(p_map, cell_m), seen).first->second;
      if (seen.sigma_m < kept.sigma_m) {
        kept = seen;
      }
    }
  }
  std::vector<MapSurfel> surfels;
  surfels.reserve(best.size());
  for (const auto& [cube, surfel] : best) {
    surfels.push_back(surfel);
  }
  return surfels;
}

}  // namespace geoflow::slam
