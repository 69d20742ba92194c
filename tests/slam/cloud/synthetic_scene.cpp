#include "synthetic_scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"

namespace geoflow::tests {
namespace {

/// z of the nearest face along the ray (x, y, 1) of the camera; infinity when it meets none.
double depth_along(const Scene& scene, const SE3& T_world_cam, const Vector3d& ray) {
  constexpr double kNearestM = 0.05;
  const Vector3d direction = T_world_cam.rotation() * ray;
  const Vector3d& origin = T_world_cam.translation();
  double nearest = std::numeric_limits<double>::infinity();
  for (const Face& face : scene) {
    const double z = (face.offset - face.normal.dot(origin)) / face.normal.dot(direction);
    if (z < kNearestM || z >= nearest) {
      continue;
    }
    const Vector3d hit = origin + z * direction;
    constexpr double kSlackM = 1e-9;
    if ((hit.array() >= face.low.array() - kSlackM).all() &&
        (hit.array() <= face.high.array() + kSlackM).all()) {
      nearest = z;
    }
  }
  return nearest;
}

/// Inverse of the lens model by fixed-point iteration, independent of the code under test.
Vector3d ray_of(const CameraIntrinsics& camera, double u, double v) {
  const Vector2d image{(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy};
  Vector2d ray = image;
  const auto& k = camera.distortion;
  if (camera.model == DistortionModel::kRadtan) {
    for (int i = 0; i < 100; ++i) {
      const double r2 = ray.squaredNorm();
      const double radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
      const Vector2d tangential{2 * k[2] * ray.x() * ray.y() + k[3] * (r2 + 2 * ray.x() * ray.x()),
                                k[2] * (r2 + 2 * ray.y() * ray.y()) + 2 * k[3] * ray.x() * ray.y()};
      ray = (image - tangential) / radial;
    }
  }
  return ray.homogeneous();
}

/// Of a pixel in row order.
std::size_t index_of(const CameraIntrinsics& camera, int u, int v) {
  return static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) +
         static_cast<std::size_t>(u);
}

/// White noise averaged over squares, at the given standard deviation after averaging.
std::vector<double> noise_image(const CameraIntrinsics& camera, const DepthNoise& noise,
                                std::mt19937_64& random) {
  const auto size =
      static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  std::vector<double> white(size);
  const double sigma = noise.inverse_depth_sigma * noise.blur_px;  // may be 0
  std::normal_distribution<double> normal;
  std::ranges::generate(white, [&] { return sigma * normal(random); });
  if (noise.blur_px == 1) {
    return white;
  }
  std::vector<double> blurred(size);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      double sum = 0;
      for (int i = 0; i < noise.blur_px * noise.blur_px; ++i) {
        const int row = std::min(v + i / noise.blur_px, camera.height - 1);
        const int column = std::min(u + i % noise.blur_px, camera.width - 1);
        sum += white[index_of(camera, column, row)];
      }
      blurred[index_of(camera, u, v)] = sum / (noise.blur_px * noise.blur_px);
    }
  }
  return blurred;
}

Scene box(const Vector3d& low, const Vector3d& high) {
  Scene faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const Vector3d& corner : {low, high}) {
      faces.push_back({Vector3d::Unit(axis), corner[axis], low, high});
      faces.back().low[axis] = corner[axis];
      faces.back().high[axis] = corner[axis];
    }
  }
  return faces;
}

}  // namespace

CameraIntrinsics vga_camera() {
  return {.width = 640, .height = 480, .fx = 520, .fy = 520, .cx = 319.5, .cy = 239.5};
}

Scene wall() {
  return {{Vector3d::UnitZ(), 2.0}};
}

Scene corridor() {
  return {{Vector3d::UnitX(), -1.0},
          {Vector3d::UnitX(), 1.0},
          {Vector3d::UnitY(), -1.2},
          {Vector3d::UnitY(), 0.9}};
}

Scene room_corner() {
  return {{Vector3d::UnitY(), 0.8},
          {Vector3d{1, 0, 1}.normalized(), 2.2},
          {Vector3d{-1, 0, 1}.normalized(), 2.0}};
}

Scene wall_with_box() {
  Scene scene = box({-0.4, -0.3, 1.4}, {0.3, 0.4, 1.9});
  scene.push_back({Vector3d::UnitZ(), 2.5});
  return scene;
}

Scene room() {
  Scene scene = room_corner();
  for (const Face& face : box({-0.6, 0.2, 1.2}, {-0.1, 0.8, 1.6})) {
    scene.push_back(face);
  }
  scene.push_back({Vector3d{0.2, 0.5, 1}.normalized(), 1.7, {0.2, -0.6, 1.0}, {1.0, 0.3, 3.0}});
  return scene;
}

FrameRef render(const Scene& scene, const SE3& T_world_cam, const CameraIntrinsics& camera,
                double depth_unit_m, const DepthNoise& noise) {
  FramePool pool{1};
  FrameRef frame = pool.acquire({camera.width, camera.height, PixelFormat::kDepth16});
  std::mt19937_64 random{noise.seed};
  std::uniform_real_distribution<double> chance{0, 1};
  const std::vector<double> errors = noise_image(camera, noise, random);
  std::vector<std::uint16_t> pixels(errors.size());
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const std::size_t pixel = index_of(camera, u, v);
      const double z = depth_along(scene, T_world_cam, ray_of(camera, u, v));
      const double counts = std::isfinite(z) ? 1.0 / (1.0 / z + errors[pixel]) / depth_unit_m : 0.0;
      const bool hole = noise.hole_probability > 0 && chance(random) < noise.hole_probability;
      const bool shown = !hole && counts > 0 && counts < std::numeric_limits<std::uint16_t>::max();
      pixels[pixel] = shown ? static_cast<std::uint16_t>(std::lround(counts)) : std::uint16_t{0};
    }
  }
  std::ranges::copy(std::as_bytes(std::span{pixels}), frame.writable_bytes().begin());
  return frame;
}

}  // namespace geoflow::tests
