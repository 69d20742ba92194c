#pragma once

#include <optional>
#include <span>
#include <vector>

#include "map/map.hpp"
#include "odometry/frame.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {

/// Which map point each of `features` of the frame shows: points of keyframes that see the same
/// surfaces from the frame's pose, projected, within `radius_px` of the feature, alike in
/// descriptor, and not contradicted by the feature's depth. Points that are among the frame's
/// features already are left out. Pure.
[[nodiscard]] std::vector<std::optional<PointId>> find_points(const Map& map, const Frame& frame,
                                                              std::span<const Feature> features,
                                                              double radius_px,
                                                              const CameraModel& camera);

}  // namespace geoflow::slam
