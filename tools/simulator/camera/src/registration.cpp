#include "src/registration.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// Projects the corner (x, y) of a depth pixel of that depth.
struct Projection {
  View ir;  // in the colour camera's frame
  Pinhole pinhole;
  float fx;
  float fy;
  float cx;
  float cy;

  [[nodiscard]] Vector3f point(float x, float y, float depth_m) const {
    return ir.R_world_cam * (depth_m * pinhole.direction(x, y)) + ir.p_world_cam;
  }
  [[nodiscard]] Vector2f pixel(const Vector3f& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
};

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
      const int left = std::max(0, static_cast<int>(low.x() + 0.5F));
      const int top = std::max(0, static_cast<int>(low.y() + 0.5F));
      const int right = std::min(color.width - 1, static_cast<int>(high.x() + 0.5F));
      const int bottom = std::min(color.height - 1, static_cast<int>(high.y() + 0.5F));
      for (int row = top; row <= bottom; ++row) {
        for (int column = left; column <= right; ++column) {
          std::uint16_t& pixel =
              out_mm[static_cast<std::size_t>(row) * static_cast<std::size_t>(color.width) +
                     static_cast<std::size_t>(column)];
          const auto value = static_cast<std::uint16_t>(millimetres);
          pixel = pixel == 0 ? value : std::min(pixel, value);
        }
      }
    }
  }
}

}  // namespace geoflow::simulator
