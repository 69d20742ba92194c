#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "inertial/gyro_turn.hpp"
#include "inertial/up_direction.hpp"
#include "map/map.hpp"

/// What goes into and comes out of one bundle adjustment, local or of the whole map: plain
/// snapshots, so that it can run in any thread.
namespace geoflow::slam {

struct MappingKeyframe {
  KeyframeId id;
  SE3 T_odom_cam;
  bool fixed = false;
  std::shared_ptr<const DepthCloud> cloud;  ///< null: none
  GyroTurn gyro{};                          ///< in the motion from the keyframe before
  std::optional<UpDirection> up{};          ///< in the camera's frame
};

struct MappingPoint {
  PointId id;
  Vector3d p_odom;
  std::vector<Observation> observations;  ///< only by keyframes of the problem
};

/// A pair of keyframes whose depth is to be registered first.
struct EdgeToMeasure {
  KeyframeId from{};
  KeyframeId to{};
  /// What legs and IMU alone say of their motion; none where they were not heard all the way.
  std::optional<RelativeEdge> reckoned{};
};

struct MappingProblem {
  std::vector<MappingKeyframe> keyframes;  ///< in order of id; at least one is fixed
  std::vector<MappingPoint> points;
  std::vector<RelativeEdge> edges;     ///< known ones between keyframes of the problem
  double gyro_random_walk = 0;         ///< ImuNoise::gyro_random_walk
  std::optional<UpDirection> up_odom;  ///< none: gravity was not felt in this part of the map
  std::vector<EdgeToMeasure> edges_to_measure;
  CameraIntrinsics camera;
  PoseConfig pose;
  MappingConfig mapping;
  GicpConfig gicp;
  bool whole_map = false;  ///< all keyframes of the part but the oldest move
};

struct MappingSolution {
  std::map<KeyframeId, SE3> T_odom_cam;                  ///< of the keyframes that moved
  std::map<PointId, Vector3d> p_odom;                    ///< of the points that moved
  std::vector<std::pair<PointId, KeyframeId>> outliers;  ///< observations that contradict the rest
  std::vector<RelativeEdge> measured;                    ///< registrations that succeeded
  std::map<KeyframeId, Vector3d> gyro_bias;  ///< GyroTurn::bias of the keyframes that moved
  bool whole_map = false;                    ///< as in the problem
};

}  // namespace geoflow::slam
