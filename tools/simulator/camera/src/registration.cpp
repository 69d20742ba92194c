#include "src/registration.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/lanes.hpp"

#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kMillimetres = 1000.0F;

/// Projects corners of depth pixels into the colour image. By value in vector loops.
struct Projection {
  View ir;  // in the colour camera's frame
  Pinhole pinhole;
  float fx = 0;
  float fy = 0;
  float cx = 0;
  float cy = 0;

  struct Place {
    float x;  ///< [px]
    float y;
    float depth_m;
  };
  [[nodiscard, gnu::always_inline]] Place project(float x, float y, float depth_m) const {
    const float along_x = depth_m * ((x - pinhole.cx) * pinhole.inverse_fx);
    const float along_y = depth_m * ((y - pinhole.cy) * pinhole.inverse_fy);
    const auto axis = [&](int i) __attribute__((always_inline)) {
      return ir.R_world_cam(i, 0) * along_x + ir.R_world_cam(i, 1) * along_y +
             ir.R_world_cam(i, 2) * depth_m + ir.p_world_cam[i];
    };
    const float z = axis(2);
    return {.x = fx * axis(0) / z + cx, .y = fy * axis(1) / z + cy, .depth_m = z};
  }
};

/// The pixel that a place in an image lies in; pixel 0 reaches from -0.5 to 0.5. Beyond the image,
/// one that is not in it.
[[gnu::always_inline]] inline int pixel_at(float place, int size) {
  return static_cast<int>(held(place + 0.5F, -1.0F, static_cast<float>(size)));
}

/// What pixels of the colour image some pixels of the depth image cover, the last ones included,
/// and in which depth.
struct Covered {
  std::array<int, kLanes> left{};
  std::array<int, kLanes> top{};
  std::array<int, kLanes> right{};
  std::array<int, kLanes> bottom{};
  std::array<int, kLanes> depth_mm{};  ///< 0: none
};

/// Of the pixels (x, y), (x + 1, y), … with those depths.
Covered cover(const Projection& projection, const CameraIntrinsics& color, const Lanes& depths_m,
              int x, int y) {
  constexpr float kNearest_m = 0.01F;
  constexpr int kLargest_mm = std::numeric_limits<std::uint16_t>::max();
  Covered covered;
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // Copies: GCC makes no vectors of what it loads through a constant reference in here.
    // NOLINTNEXTLINE(performance-unnecessary-copy-initialization)
    const Projection to_color = projection;
    const Lanes all_m = depths_m;
    Covered found;
    const int width = color.width;
    const int height = color.height;
    const auto row = static_cast<float>(y);
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float depth_m = all_m[i];
      const auto column = static_cast<float>(x + static_cast<int>(i));
      const float centre_m = to_color.project(column, row, depth_m).depth_m;
      const float rounded =
          held(kMillimetres * centre_m + 0.5F, 0.0F, static_cast<float>(kLargest_mm + 1));
      // One choice after the other: GCC makes no vectors of a choice between truths.
      const auto millimetres = static_cast<int>(rounded);
      const int held_mm = millimetres <= kLargest_mm ? millimetres : 0;
      const int far_mm = centre_m >= kNearest_m ? held_mm : 0;
      found.depth_mm[i] = depth_m > 0.0F ? far_mm : 0;
      const auto low = to_color.project(column - 0.5F, row - 0.5F, depth_m);
      const auto high = to_color.project(column + 0.5F, row + 0.5F, depth_m);
      found.left[i] = std::max(0, pixel_at(low.x, width));
      found.top[i] = std::max(0, pixel_at(low.y, height));
      found.right[i] = std::min(width - 1, pixel_at(high.x, width));
      found.bottom[i] = std::min(height - 1, pixel_at(high.y, height));
    }
    covered = found;
  });
  return covered;
}

/// Leaves in each pixel that a lane covers the nearest depth; 0 is none.
void fill_nearest(const Covered& covered, std::size_t lane, int width,
                  std::span<std::uint16_t> out_mm) {
  const auto depth_mm = static_cast<std::uint16_t>(covered.depth_mm[lane]);
  for (int row = covered.top[lane]; row <= covered.bottom[lane]; ++row) {
    for (int column = covered.left[lane]; column <= covered.right[lane]; ++column) {
      std::uint16_t& pixel =
          out_mm[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
      pixel = pixel == 0 ? depth_mm : std::min(pixel, depth_mm);
    }
  }
}

/// The same for all lanes.
void fill_nearest(const Covered& covered, int width, std::span<std::uint16_t> out_mm) {
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (covered.depth_mm[lane] != 0) {
      fill_nearest(covered, lane, width, out_mm);
    }
  }
}

}  // namespace

void align_to_color(const std::vector<float>& depth_m, const Registration& registration,
                    std::span<std::uint16_t> out_mm) {
  const CameraIntrinsics& color = registration.color;
  const Projection projection{.ir = View{registration.T_cam_ir},
                              .pinhole = Pinhole{registration.depth},
                              .fx = static_cast<float>(color.fx),
                              .fy = static_cast<float>(color.fy),
                              .cx = static_cast<float>(color.cx),
                              .cy = static_cast<float>(color.cy)};
  std::ranges::fill(out_mm, std::uint16_t{0});
  const auto width = static_cast<std::size_t>(registration.depth.width);
  for (int y = 0; y < registration.depth.height; ++y) {
    const std::span row = std::span{depth_m}.subspan(static_cast<std::size_t>(y) * width, width);
    for (std::size_t x = 0; x < width; x += kLanes) {
      Lanes depths_m{};
      std::ranges::copy(row.subspan(x, std::min(kLanes, width - x)), depths_m.begin());
      fill_nearest(cover(projection, color, depths_m, static_cast<int>(x), y), color.width, out_mm);
    }
  }
}

}  // namespace geoflow::simulator
