#include "cloud/pixel_depth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

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

/// The cell of a raw pixel; none beyond the last whole cells.
std::optional<std::size_t> cell_at(const CellGrid& grid, const Eigen::Vector2d& raw) {
  const Eigen::Vector2i cell = (raw.array() / grid.cell_px()).floor().cast<int>();
  if (cell.minCoeff() < 0 || cell.x() >= grid.columns() || cell.y() >= grid.rows()) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(cell.y() * grid.columns() + cell.x());
}

}  // namespace

const Surfel* surface_at(const DepthCloud& cloud, const Eigen::Vector2d& raw,
                         const Eigen::Vector3d& p_cam) {
  if (const auto cell = cell_at(cloud.grid(), raw); cell && cloud.surfels()[*cell].valid()) {
    return &cloud.surfels()[*cell];
  }
  constexpr int kFarthestCells = 12;
  constexpr double kSamePlane =
      0.02;  // of the distance: what a normal's error makes of the way there
  const CellGrid& grid = cloud.grid();
  const Eigen::Vector2i middle = (raw.array() / grid.cell_px()).floor().cast<int>();
  const auto goes_on = [&](const Surfel& surfel) {
    const Eigen::Vector3d from_surfel = p_cam - surfel.point.cast<double>();
    return std::abs(surfel.normal.cast<double>().dot(from_surfel)) < kSamePlane * p_cam.norm();
  };
  const Surfel* nearest = nullptr;
  int least = std::numeric_limits<int>::max();
  for (int y = std::max(middle.y() - kFarthestCells, 0);
       y <= std::min(middle.y() + kFarthestCells, grid.rows() - 1); ++y) {
    for (int x = std::max(middle.x() - kFarthestCells, 0);
         x <= std::min(middle.x() + kFarthestCells, grid.columns() - 1); ++x) {
      const int in_row_order = y * grid.columns() + x;
      const Surfel& surfel = cloud.surfels()[static_cast<std::size_t>(in_row_order)];
      const int distance = (Eigen::Vector2i{x, y} - middle).squaredNorm();
      if (distance < least && surfel.has_depth() && goes_on(surfel)) {
        nearest = &surfel;
        least = distance;
      }
    }
  }
  return nearest;
}

double depth_at(const DepthCloud& cloud, const FrameRef& depth, const Eigen::Vector2d& raw,
                double expected_m) {
  const CellGrid& grid = cloud.grid();
  const double measured = median_depth(depth, raw) * cloud.pixels().unit_m;
  const std::optional<std::size_t> cell = cell_at(grid, raw);
  if (measured == 0 || !cell) {
    return measured;
  }
  const Surfel& surfel = cloud.surfels()[*cell];
  if (!surfel.has_depth()) {
    return 0;
  }
  const CellGrid::Ray& ray = grid.ray(*cell);
  const Eigen::Vector2d middle =
      ((raw.array() / grid.cell_px()).floor() + 0.5) * grid.cell_px() - 0.5;
  const Eigen::Vector3d normal = surfel.normal.cast<double>();
  const auto inverse_depth_at = [&](const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d at =
        ray.centre.cast<double>() + ray.per_pixel.cast<double>() * (pixel - middle);
    return normal.dot(at.homogeneous()) / normal.dot(surfel.point.cast<double>());
  };
  const double inverse_depth = inverse_depth_at(raw);
  // A steep view of a floor may show what it mirrors: behind the floor, whatever its texture.
  constexpr double kAgrees = 0.1;
  constexpr float kSteepCosine = 0.208F;  // 78 degrees off the normal
  const bool steep = -surfel.normal.dot(surfel.point) < kSteepCosine * surfel.point.norm();
  if ((steep || !surfel.valid()) && !(std::abs(expected_m * inverse_depth - 1.0) < kAgrees)) {
    return 0;
  }
  constexpr double kOnSurfaceSigmas = 3.0;
  const Eigen::Vector2d measured_at = raw.array().round();
  const double off = std::abs(inverse_depth_at(measured_at) - 1.0 / measured);
  return off < kOnSurfaceSigmas * static_cast<double>(cloud.sigma()) ? 1.0 / inverse_depth : 0;
}

}  // namespace geoflow::slam
