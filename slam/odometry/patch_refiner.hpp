#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"

#include "map/map.hpp"
#include "vision/camera_model.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/patch_alignment.hpp"

namespace geoflow::slam {

/// Finds a map point in a frame to a fraction of a pixel: its patch in the earliest keyframe that
/// saw it from near enough, laid on the surface there and seen from the frame's pose, is aligned
/// with the frame. Following from frame to frame only has to come near. Thread-safe.
class PatchRefiner {
 public:
  explicit PatchRefiner(const CameraModel& camera) : camera_{camera} {}

  /// Looks for `point` in `current`, which stands about at `T_odom_cam`, near `raw`. Unknown where
  /// no keyframe's view will do.
  [[nodiscard]] PatchSearch refine(const Map& map, const MapPoint& point, const SE3& T_odom_cam,
                                   const ImagePyramid& current, const Vector2d& raw) const;

 private:
  [[nodiscard]] std::optional<PatchWarp> warp(const Keyframe& reference, const Vector3d& p_odom,
                                              const Vector2d& ideal, const SE3& T_odom_cam,
                                              const Vector2d& raw) const;

  CameraModel camera_;
};

}  // namespace geoflow::slam
