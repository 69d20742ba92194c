#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/time.hpp"

#include "cloud/depth_cloud.hpp"
#include "map/map.hpp"
#include "vision/image_pyramid.hpp"

namespace geoflow::slam {

/// A feature followed from frame to frame.
struct Feature {
  /// Where a feature without depth was first seen by a keyframe: half of a later triangulation.
  struct Anchor {
    KeyframeId keyframe;
    Vector2d pixel;  ///< ideal
  };

  Vector2d raw;        ///< raw pixel
  Vector2d ideal;      ///< ideal pixel
  double depth_m = 0;  ///< measured z; 0: none
  std::optional<PointId> point{};
  std::optional<Anchor> anchor{};
  Descriptor descriptor{};  ///< as first seen by a keyframe
};

/// What is kept of a frame until the next one has been tracked.
struct Frame {
  HostTime t;
  ImagePyramid pyramid;
  FrameRef depth;                           ///< empty: none
  std::shared_ptr<const DepthCloud> cloud;  ///< null: none
  std::vector<Feature> features;
  SE3 T_odom_cam;
};

/// Depth [m] at a raw pixel: the median of its 3 x 3 neighbourhood; 0 where fewer than five pixels
/// have a measurement or they spread over a depth discontinuity (more than 5 %), where one pixel's
/// depth belongs to either side.
[[nodiscard]] double depth_at(const FrameRef& depth, const Vector2d& raw, double depth_unit_m);

}  // namespace geoflow::slam
