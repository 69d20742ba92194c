#include "cloud/pixel_depth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "geoflow/hal/image.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {
namespace {

/// The median [counts] of the 3 x 3 neighbourhood of a raw pixel; 0: none.
double median_depth(const FrameRef& depth, const Eigen::Vector2d& raw) {
  constexpr std::size_t kSide = 3;
  constexpr std::size_t kEnough = 5;
  constexpr double kDiscontinuity = 0.05;
  if (!depth) {
    return 0;
  }
  const ImageShape& shape = depth.shape();
  const int column = static_cast<int>(std::lround(raw.x()));
  const int row = static_cast<int>(std::lround(raw.y()));
  std::array<std::uint16_t, kSide * kSide> values{};
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
  return spread > kDiscontinuity * median ? 0 : median;
}

}  // namespace

double depth_at(const DepthCloud& cloud, const FrameRef& depth, const Eigen::Vector2d& raw) {
  const CellGrid& grid = cloud.grid();
  const double measured = median_depth(depth, raw) * cloud.pixels().unit_m;
  const Eigen::Vector2i cell = (raw.array() / grid.cell_px()).floor().cast<int>();
  if (measured == 0 || cell.x() >= grid.columns() || cell.y() >= grid.rows()) {
    return measured;
  }
  const int in_row_order = cell.y() * grid.columns() + cell.x();
  const auto index = static_cast<std::size_t>(in_row_order);
  const Surfel& surfel = cloud.surfels()[index];
  if (!surfel.valid()) {
    return 0;
  }
  const CellGrid::Ray& ray = grid.ray(index);
  const Eigen::Vector2d middle = (cell.cast<double>().array() + 0.5) * grid.cell_px() - 0.5;
  const Eigen::Vector2d at =
      ray.centre.cast<double>() + ray.per_pixel.cast<double>() * (raw - middle);
  const Eigen::Vector3d normal = surfel.normal.cast<double>();
  const double inverse_depth =
      normal.dot(at.homogeneous()) / normal.dot(surfel.point.cast<double>());
  constexpr double kOnSurfaceSigmas = 3.0;
  const double off = std::abs(inverse_depth - 1.0 / measured);
  return off < kOnSurfaceSigmas * static_cast<double>(cloud.sigma()) ? 1.0 / inverse_depth : 0;
}

}  // namespace geoflow::slam
