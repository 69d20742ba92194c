#include "odometry/frame.hpp"

#include "geoflow/hal/geometry.hpp"

#include "vision/camera_model.hpp"
#include "vision/row_time.hpp"

namespace geoflow::slam {

Feature Frame::feature_at(const Vector2d& raw, const CameraModel& camera,
                          double expected_depth_m) const {
  Feature feature{
      .raw = raw, .ideal = camera.undistort(raw), .depth_m = depth_at(raw, expected_depth_m)};
  if (rows.readout_s != 0) {
    const double depth_m = feature.depth_m > 0 ? feature.depth_m : expected_depth_m;
    feature.ideal +=
        rows.readout_s * row_shift(camera, rows.twist, feature.ideal, raw.y(), depth_m);
    feature.depth_m = depth_at(camera.distort(feature.ideal), expected_depth_m);
  }
  return feature;
}

}  // namespace geoflow::slam
