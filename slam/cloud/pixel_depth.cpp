#include "cloud/pixel_depth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"

namespace geoflow::slam {

double depth_at(const FrameRef& depth, const Vector2d& raw, double depth_unit_m) {
  constexpr std::size_t kEnough = 5;
  constexpr double kDiscontinuity = 0.05;
  if (!depth) {
    return 0;
  }
  const ImageShape& shape = depth.shape();
  const int column = static_cast<int>(std::lround(raw.x()));
  const int row = static_cast<int>(std::lround(raw.y()));
  std::array<std::uint16_t, 9> values{};
  std::size_t count = 0;
  for (int y = std::max(0, row - 1); y <= std::min(shape.height - 1, row + 1); ++y) {
    for (int x = std::max(0, column - 1); x <= std::min(shape.width - 1, column + 1); ++x) {
      const std::uint16_t value = depth.row<std::uint16_t>(y)[x];
      if (value != 0) {
        values.at(count++) = value;
      }
    }
  }
  if (count < kEnough) {
    return 0;
  }
  std::sort(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count));
  const double median = values.at(count / 2);
  const double spread = values.at(count - 1) - values.front();
  return spread > kDiscontinuity * median ? 0 : median * depth_unit_m;
}

}  // namespace geoflow::slam
