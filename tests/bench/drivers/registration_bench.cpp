#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <benchmark/benchmark.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "d435i/pixels/registration.hpp"

// Depth registered to colour at 640x480: the driver's kernel, and what it is measured against: the
// usual way, which projects two corners of each depth pixel's outline and gives every colour pixel
// between them the nearest depth that touches it.

namespace {

using geoflow::CameraIntrinsics;
using geoflow::SE3;
using geoflow::Vector3d;
using geoflow::drivers::d435i::DepthRegistration;
using geoflow::drivers::d435i::RegistrationGeometry;

constexpr double kDepthUnit_m = 1e-3;

/// A real D435i's numbers.
RegistrationGeometry geometry() {
  const Vector3d turn{0.00086, -0.00069, 0.0094};
  const Vector3d p_depth_cam{-0.01501, 0.00136, -0.00025};
  return {
      .depth = {.width = 640, .height = 480, .fx = 382.9, .fy = 382.9, .cx = 319.9, .cy = 236.1},
      .color = {.width = 640, .height = 480, .fx = 612.4, .fy = 610.6, .cx = 314.3, .cy = 237.8},
      .T_cam_depth = SE3{geoflow::so3::exp(turn), p_depth_cam}.inverse(),
      .depth_unit_m = kDepthUnit_m};
}

/// A corridor: floor, walls and end, with boxes and holes, so that there are edges.
std::vector<std::uint16_t> scene(const CameraIntrinsics& camera) {
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const double x = (u - camera.cx) / camera.fx;
      const double y = (v - camera.cy) / camera.fy;
      double z = 6;
      z = y > 0 ? std::min(z, 0.3 / y) : z;
      z = x != 0 ? std::min(z, 1 / std::abs(x)) : z;
      const bool box = (u / 64 + v / 60) % 5 == 0;
      const bool hole = u % 97 < 4 && v % 61 < 4;
      z = hole ? 0 : std::min(z, box ? 1.5 : z);
      depth.push_back(static_cast<std::uint16_t>(std::lround(z / kDepthUnit_m)));
    }
  }
  return depth;
}

class PlainRegistration {
 public:
  explicit PlainRegistration(const RegistrationGeometry& geometry) : geometry_{geometry} {}

  void run(std::span<const std::uint16_t> depth, std::span<std::uint16_t> target) const {
    std::ranges::fill(target, std::uint16_t{0});
    const CameraIntrinsics& camera = geometry_.depth;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const auto z = depth[static_cast<std::size_t>(v * camera.width + u)];
        if (z != 0) {
          fill(target, z, project(u - 0.5, v - 0.5, z), project(u + 0.5, v + 0.5, z));
        }
      }
    }
  }

 private:
  [[nodiscard]] std::array<int, 2> project(double u, double v, std::uint16_t counts) const {
    const double z = counts * geometry_.depth_unit_m;
    const Vector3d p_depth{(u - geometry_.depth.cx) / geometry_.depth.fx * z,
                           (v - geometry_.depth.cy) / geometry_.depth.fy * z, z};
    const Vector3d p_cam = geometry_.T_cam_depth * p_depth;
    const CameraIntrinsics& color = geometry_.color;
    return {static_cast<int>(color.fx * p_cam.x() / p_cam.z() + color.cx + 0.5),
            static_cast<int>(color.fy * p_cam.y() / p_cam.z() + color.cy + 0.5)};
  }

  void fill(std::span<std::uint16_t> target, std::uint16_t z, std::array<int, 2> first,
            std::array<int, 2> last) const {
    const CameraIntrinsics& color = geometry_.color;
    if (first[0] < 0 || first[1] < 0 || last[0] >= color.width || last[1] >= color.height) {
      return;
    }
    for (int v = first[1]; v <= last[1]; ++v) {
      for (int u = first[0]; u <= last[0]; ++u) {
        auto& kept = target[static_cast<std::size_t>(v * color.width + u)];
        kept = kept == 0 ? z : std::min(kept, z);
      }
    }
  }

  RegistrationGeometry geometry_;
};

void plain(benchmark::State& state) {
  const PlainRegistration registration{geometry()};
  const auto depth = scene(geometry().depth);
  std::vector<std::uint16_t> target(depth.size());
  for (auto _ : state) {
    registration.run(depth, target);
    benchmark::DoNotOptimize(target.data());
  }
}
BENCHMARK(plain)->Unit(benchmark::kMillisecond);

void own(benchmark::State& state) {
  auto registration = DepthRegistration::create(geometry());
  const auto depth = scene(geometry().depth);
  std::vector<std::uint16_t> target(depth.size());
  for (auto _ : state) {
    if (!registration->run(std::as_bytes(std::span{depth}), target)) {
      state.SkipWithError("refused");
      return;
    }
    benchmark::DoNotOptimize(target.data());
  }
}
BENCHMARK(own)->Unit(benchmark::kMillisecond);

}  // namespace
