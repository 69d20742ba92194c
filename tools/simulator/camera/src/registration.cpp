#include "src/registration.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"

#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// Projects the corner (x, y) of a depth pixel of that depth.
struct Projection {
  View ir;  // in the colour camera's frame
  Pinhole pinhole;
  float fx = 0;
  float fy = 0;
  float cx = 0;
  float cy = 0;

  [[nodiscard]] Vector3f point(float x, float y, float depth_m) const {
    return ir.R_world_cam * (depth_m * pinhole.direction(x, y)) + ir.p_world_cam;
  }
  [[nodiscard]] Vector2f pixel(const Vector3f& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
};

/// The pixel that a place in an image lies in; pixel 0 reaches from -0.5 to 0.5.
int pixel_at(float place) {
  const float from_edge = place + 0.5F;
  return static_cast<int>(from_edge);
}

/// Pixels of an image, the last ones included.
struct Patch {
  int left;
  int top;
  int right;
  int bottom;
};

/// Leaves in each pixel of the patch the nearest depth; 0 is none.
void fill_nearest(const Patch& patch, std::uint16_t depth_mm, int width,
                  std::span<std::uint16_t> out_mm) {
  for (int row = patch.top; row <= patch.bottom; ++row) {
    for (int column = patch.left; column <= patch.right; ++column) {
      std::uint16_t& pixel =
          out_mm[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
      pixel = pixel == 0 ? depth_mm : std::min(pixel, depth_mm);
    }
  }
}

}  // namespace

void align_to_color(const std::vector<float>& depth_m, const Registration& registration,
                    std::span<std::uint16_t> out_mm) {
  constexpr float kMillimetres = 1000.0F;
  constexpr float kNearest_m = 0.01F;
  constexpr auto kLargest = static_cast<float>(std::numeric_limits<std::uint16_t>::max());
  const CameraIntrinsics& color = registration.color;
  const Projection projection{.ir = View{registration.T_cam_ir},
                              .pinhole = Pinhole{registration.depth},
                              .fx = static_cast<float>(color.fx),
                              .fy = static_cast<float>(color.fy),
                              .cx = static_cast<float>(color.cx),
                              .cy = static_cast<float>(color.cy)};
  std::ranges::fill(out_mm, std::uint16_t{0});
  for (int y = 0; y < registration.depth.height; ++y) {
    for (int x = 0; x < registration.depth.width; ++x) {
      const float depth =
          depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(registration.depth.width) +
                  static_cast<std::size_t>(x)];
      const auto at_x = static_cast<float>(x);
      const auto at_y = static_cast<float>(y);
      const Vector3f centre = projection.point(at_x, at_y, depth);
      const float millimetres = std::round(kMillimetres * centre.z());
      if (depth <= 0 || centre.z() < kNearest_m || millimetres > kLargest) {
        continue;
      }
      const Vector2f low = projection.pixel(projection.point(at_x - 0.5F, at_y - 0.5F, depth));
      const Vector2f high = projection.pixel(projection.point(at_x + 0.5F, at_y + 0.5F, depth));
      fill_nearest({.left = std::max(0, pixel_at(low.x())),
                    .top = std::max(0, pixel_at(low.y())),
                    .right = std::min(color.width - 1, pixel_at(high.x())),
                    .bottom = std::min(color.height - 1, pixel_at(high.y()))},
                   static_cast<std::uint16_t>(millimetres), color.width, out_mm);
    }
  }
}

}  // namespace geoflow::simulator
