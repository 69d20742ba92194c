#pragma once

#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/scene.hpp"

/// What the simulated camera's tests look at and where from.
namespace geoflow::simulator::tests {

/// A camera at (x, y, 0.4) that looks along `yaw_rad` and down by `pitch_rad`.
inline SE3 looking(double x, double y, double yaw_rad, double pitch_rad = 0) {
  const Matrix3d R_world_base = (Eigen::AngleAxisd{yaw_rad, Vector3d::UnitZ()} *
                                 Eigen::AngleAxisd{pitch_rad, Vector3d::UnitY()})
                                    .toRotationMatrix();
  Matrix3d R_base_cam;
  R_base_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return SE3{Matrix3d{R_world_base * R_base_cam}, Vector3d{x, y, 0.4}};
}

/// An empty world under a white sky.
inline Scene daylight_scene() {
  Scene scene;
  scene.name = "test";
  scene.daylight = Daylight{.to_sun = Eigen::Vector3f::UnitZ(), .sky_nit = 200.0F};
  return scene;
}

/// Adds an upright wall at x, from y_low to y_high, that looks to -x, of that uniform reflectance.
inline void add_wall(Scene& scene, float x, float y_low, float y_high, float reflectance) {
  constexpr float kHalfHeight_m = 30.0F;
  scene.materials.push_back({.albedo = Rgb{reflectance, reflectance, reflectance, 0}});
  Patch wall;
  wall.origin = {x, y_high, -kHalfHeight_m};
  wall.axis_u = -Eigen::Vector3f::UnitY();
  wall.axis_v = Eigen::Vector3f::UnitZ();
  wall.size_m = {y_high - y_low, 2 * kHalfHeight_m};
  const Eigen::Vector3f u = wall.size_m.x() * wall.axis_u;
  const Eigen::Vector3f v = wall.size_m.y() * wall.axis_v;
  wall.corners = {wall.origin, wall.origin + u, wall.origin + u + v, wall.origin + v};
  wall.material = static_cast<int>(scene.materials.size()) - 1;
  scene.patches.push_back(wall);
}

/// Options without anything random.
inline CameraOptions exact_options() {
  CameraOptions options;
  options.noise_scale = 0;
  options.depth_noise_scale = 0;
  options.depth_errors = false;
  options.depth_truth = true;
  return options;
}

inline std::uint16_t depth_mm(const Rendered& rendered, int x, int y) {
  return rendered.depth.row<std::uint16_t>(y)[x];
}

inline double blue(const Rendered& rendered, int x, int y) {
  return rendered.color.row<std::uint8_t>(y)[std::ptrdiff_t{3} * x];
}

inline double truth_m(const Rendered& rendered, int x, int y) {
  const auto width = static_cast<std::size_t>(rendered.color.shape().width);
  return static_cast<double>(
      rendered.depth_truth[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)]);
}

}  // namespace geoflow::simulator::tests
