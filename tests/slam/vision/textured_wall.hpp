#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "vision/camera_model.hpp"

namespace geoflow::slam {

/// A camera without distortion, 320 x 240.
[[nodiscard]] CameraIntrinsics wall_camera();

/// A wall in the plane z = distance of odom, tiled at random in gray squares: corners everywhere,
/// exactly known. `paint_out_left`: where x < 0 the wall is blank.
class TexturedWall {
 public:
  TexturedWall(double distance_m, std::uint64_t seed, double step_m = 0)
      : distance_m_{distance_m}, step_m_{step_m}, seed_{seed} {}

  /// What a camera sees of it (CV_8UC1), each pixel the mean over its area.
  [[nodiscard]] cv::Mat1b seen_from(const SE3& T_odom_cam) const;

  /// Where the ray of an ideal pixel meets the wall, in odom.
  [[nodiscard]] Vector3d point_at(const SE3& T_odom_cam, const Vector2d& pixel) const;

 private:
  [[nodiscard]] double tile_at(double x_m, double y_m, double side_m) const;
  [[nodiscard]] double gray_at(double x_m, double y_m) const;

  CameraModel camera_{wall_camera()};
  double distance_m_;
  double step_m_;
  std::uint64_t seed_;
};

}  // namespace geoflow::slam
