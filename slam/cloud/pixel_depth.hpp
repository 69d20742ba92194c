#pragma once

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"

namespace geoflow::slam {

/// Depth [m] at a raw pixel: the median of its 3 x 3 neighbourhood; 0 where fewer than five pixels
/// have a measurement or they spread over a depth discontinuity (more than 5 %), where one pixel's
/// depth belongs to either side; 0 of an empty frame.
[[nodiscard]] double depth_at(const FrameRef& depth, const Vector2d& raw, double depth_unit_m);

}  // namespace geoflow::slam
