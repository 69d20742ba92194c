#pragma once

#include <Eigen/Core>

#include "geoflow/hal/image.hpp"

#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {

/// Depth [m] at a raw pixel of the image that a cloud was built of: that of the surfel it lies on.
/// 0 where it lies on none, has itself no depth or another one: at the edge of a thing a pixel's
/// depth may be of what is before or behind it.
[[nodiscard]] double depth_at(const DepthCloud& cloud, const FrameRef& depth,
                              const Eigen::Vector2d& raw);

}  // namespace geoflow::slam
