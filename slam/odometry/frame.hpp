#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/time.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/pixel_depth.hpp"
#include "map/map.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/place_view.hpp"
#include "vision/row_time.hpp"

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
  std::shared_ptr<const ImagePyramid> pyramid;  ///< null in a frame that was never read
  FrameRef depth;                               ///< empty: none
  std::shared_ptr<const DepthCloud> cloud;      ///< of `depth`; null: none
  std::vector<Feature> features;
  RowMotion rows{};
  std::shared_ptr<const PlaceView> place;  ///< null until it is asked for
  SE3 T_odom_cam;
  /// Whether the pose hangs together with the map; otherwise it only follows from earlier frames.
  bool anchored = true;

  /// The feature that is seen at a raw pixel, where the middle of the image would have shown it:
  /// depth, of a global shutter, is of that time. `expected_depth_m`: what is known of it
  /// otherwise; 0: unknown.
  [[nodiscard]] Feature feature_at(const Vector2d& raw, const CameraModel& camera,
                                   double expected_depth_m = 0) const;

 private:
  /// Measured depth [m] at a raw pixel; 0: none.
  [[nodiscard]] double depth_at(const Vector2d& raw, double expected_m) const {
    return cloud ? slam::depth_at(*cloud, depth, raw, expected_m) : 0;
  }
};

}  // namespace geoflow::slam
