#include "slam/vision/textured_wall.hpp"

#include <cmath>
#include <cstdint>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

CameraIntrinsics wall_camera() {
  return {.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 159.5, .cy = 119.5};
}

Vector3d TexturedWall::point_at(const SE3& T_odom_cam, const Vector2d& pixel) const {
  const Vector3d ray = T_odom_cam.rotation() * camera_.unproject(pixel, 1);
  const Vector3d& origin = T_odom_cam.translation();
  const auto hit = [&](double z) -> Vector3d {
    return origin + ray * ((z - origin.z()) / ray.z());
  };
  const Vector3d near = hit(distance_m_ - step_m_);
  return near.x() > 0 ? near : hit(distance_m_);
}

double TexturedWall::tile_at(double x_m, double y_m, double side_m) const {
  // A hash of the tile (splitmix64's finaliser).
  auto bits = static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x_m / side_m)));
  bits = bits * 0x9E3779B97F4A7C15U +
         static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(y_m / side_m))) + seed_;
  bits = (bits ^ (bits >> 30U)) * 0xBF58476D1CE4E5B9U;
  bits = (bits ^ (bits >> 27U)) * 0x94D049BB133111EBU;
  return static_cast<double>((bits >> 31U) & 0xFFU);
}

double TexturedWall::gray_at(double x_m, double y_m) const {
  // A finer, fainter tiling within the tiles: on flat ones all pixels around a corner are equal.
  constexpr double kTileM = 0.15;
  constexpr double kFineTileM = 0.02;
  constexpr double kFineShare = 0.15;
  return (1 - kFineShare) * tile_at(x_m, y_m, kTileM) + kFineShare * tile_at(x_m, y_m, kFineTileM);
}

cv::Mat1b TexturedWall::seen_from(const SE3& T_odom_cam) const {
  constexpr int kSubpixels = 4;
  cv::Mat1b image(wall_camera().height, wall_camera().width);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      double sum = 0;
      for (int i = 0; i < kSubpixels * kSubpixels; ++i) {
        const int right = i % kSubpixels;
        const int down = i / kSubpixels;
        const Vector2d within{(right + 0.5) / kSubpixels - 0.5, (down + 0.5) / kSubpixels - 0.5};
        const Vector3d p_odom = point_at(T_odom_cam, Vector2d{u, v} + within);
        sum += gray_at(p_odom.x(), p_odom.y());
      }
      image(v, u) = static_cast<unsigned char>(std::lround(sum / (kSubpixels * kSubpixels)));
    }
  }
  return image;
}

}  // namespace geoflow::slam
