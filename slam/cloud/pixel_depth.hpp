#pragma once

#include <Eigen/Core>

#include "geoflow/hal/image.hpp"

#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {

/// The surfel that a raw pixel lies in or, where there is none, the nearest one in the image whose
/// plane goes on through `p_cam`, the pixel's point in the camera frame [m]: a floor does beyond
/// the range of depth. Null: none there.
[[nodiscard]] const Surfel* surface_at(const DepthCloud& cloud, const Eigen::Vector2d& raw,
                                       const Eigen::Vector3d& p_cam);

/// Depth [m] at a raw pixel of the image that a cloud was built of: that of the surfel it lies on.
/// 0 where it lies on none, has itself no depth or another one: at the edge of a thing a pixel's
/// depth may be of what is before or behind it. Where the surface is seen too steeply for a surfel
/// to be valid(), what the pixel shows may be mirrored, and lie elsewhere: 0 unless `expected_m`,
/// what is known of its depth without the sensor (by parallax), agrees; 0: nothing is known.
[[nodiscard]] double depth_at(const DepthCloud& cloud, const FrameRef& depth,
                              const Eigen::Vector2d& raw, double expected_m = 0);

}  // namespace geoflow::slam
