#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"

/// What a cell's neighbours say of it: DepthCloud's noise and normals.
namespace geoflow::slam {
namespace {

constexpr float kParameters = 3;  ///< of a plane
/// A neighbour belongs to a cell's surface when it is within this many sigmas of a pixel from the
/// cell's own plane, whose slope is uncertain; the joint fit decides.
constexpr float kNeighbourSigmas = 4.0F;
/// Cells, the middle one included, that a joint plane takes.
constexpr float kMinNeighbourhood = 5.0F;
/// Least determinant of the cells' scatter, relative to its diagonal: they must not lie on one
/// line.
constexpr float kMinSpread = 0.05F;
/// Cells that miss their joint plane by more than this many times their variance are curved.
constexpr float kMisfit = 1.5F;

/// Least-squares plane q = offset + slope . ray through the points of neighbouring cells.
struct PlaneFit {
  float count = 0;
  Eigen::Vector2f sum = Eigen::Vector2f::Zero();
  Eigen::Matrix2f products = Eigen::Matrix2f::Zero();
  Eigen::Vector2f with_q = Eigen::Vector2f::Zero();
  float sum_q = 0;
  float squares = 0;  ///< of q; after solve() of the residuals
  Eigen::Vector2f slope = Eigen::Vector2f::Zero();
  Eigen::Vector2f spread = Eigen::Vector2f::Zero();  ///< sums of squares about the mean ray

  void add(const Eigen::Vector2f& ray, float q) {
    count += 1.0F;
    sum += ray;
    products += ray * ray.transpose();
    with_q += q * ray;
    sum_q += q;
    squares += q * q;
  }

  /// False where the cells are too few or on one line.
  bool solve() {
    if (count < kMinNeighbourhood) {
      return false;
    }
    const Eigen::Matrix2f scatter = products - sum * sum.transpose() / count;
    const Eigen::Vector2f right = with_q - sum * (sum_q / count);
    spread = scatter.diagonal();
    const float determinant = scatter(0, 0) * scatter(1, 1) - scatter(0, 1) * scatter(0, 1);
    if (determinant < kMinSpread * spread.prod()) {
      return false;
    }
    slope.x() = (scatter(1, 1) * right.x() - scatter(0, 1) * right.y()) / determinant;
    slope.y() = (scatter(0, 0) * right.y() - scatter(0, 1) * right.x()) / determinant;
    squares -= sum_q * sum_q / count + slope.dot(right);
    return true;
  }
};

/// A matching window makes so many pixels err as one in what tilts a cell.
constexpr float kCorrelatedPixels = 16;

/// Reorders the values; there must be some.
float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Visits the cells of the grid that are so many rows or columns away from one, row by row.
template <typename Visit>
void for_each_in_ring(const CellGrid& grid, std::uint32_t cell, int ring, const Visit& visit) {
  const int columns = grid.columns();
  const int column = static_cast<int>(cell) % columns;
  const int row = static_cast<int>(cell) / columns;
  for (int r = std::max(row - ring, 0); r <= std::min(row + ring, grid.rows() - 1); ++r) {
    const int step = std::abs(r - row) == ring ? 1 : 2 * ring;
    for (int c = column - ring; c <= column + ring; c += step) {
      if (c >= 0 && c < columns) {
        visit(r * columns + c);
      }
    }
  }
}

}  // namespace

void DepthCloud::drop_edges() {
  if (valid_.empty()) {
    return;
  }
  scratch_.clear();
  for (const std::uint32_t cell : valid_) {
    scratch_.push_back(surfels_[cell].tilt_variance);
  }
  const auto least = static_cast<float>(config_.least_sigma * config_.least_sigma);
  const float typical = std::max(median(scratch_), least);
  const auto times = static_cast<float>(config_.max_plane_rms * config_.max_plane_rms);
  for (const std::uint32_t cell : valid_) {
    if (surfels_[cell].tilt_variance > times * typical) {
      surfels_[cell] = Surfel{};
    }
  }
  std::erase_if(valid_, [this](std::uint32_t cell) { return !surfels_[cell].valid(); });
}

/// Matching windows overlap, so that a cell's pixels err together, and partly with its neighbours':
/// they say little of their common error. Three cells in a row with one left out between them do,
/// whose inverse depths lie on a line where they are of one plane.
void DepthCloud::measure_noise() {
  constexpr float kNormalQuartile = 0.6745F;        // median of |x| of a Gaussian
  const float second_difference = std::sqrt(6.0F);  // per sigma: 1, -2, 1
  scratch_.clear();
  const auto columns = static_cast<std::size_t>(grid_->columns());
  const auto inverse_depth = [this](std::size_t cell) { return 1.0F / surfels_[cell].point.z(); };
  const auto add = [&](std::size_t first, std::size_t step) {
    const std::size_t middle = first + 2 * step;
    const std::size_t last = middle + 2 * step;
    if (last < surfels_.size() && surfels_[middle].valid() && surfels_[last].valid()) {
      scratch_.push_back(
          std::abs(inverse_depth(first) - 2 * inverse_depth(middle) + inverse_depth(last)));
    }
  };
  for (const std::uint32_t cell : valid_) {
    add(cell, columns);
    if (cell % columns + 4 < columns) {
      add(cell, 1);
    }
  }
  sigma_ = static_cast<float>(config_.least_sigma);
  if (!scratch_.empty()) {
    sigma_ = std::max(sigma_, median(scratch_) / (kNormalQuartile * second_difference));
  }
  const auto least = static_cast<float>(config_.least_sigma * config_.least_sigma);
  const float independent =
      std::max(1.0F, static_cast<float>(grid_->cell_px() * grid_->cell_px()) / kCorrelatedPixels);
  for (const std::uint32_t cell : valid_) {
    Surfel& surfel = surfels_[cell];
    const float distance = surfel.normal.dot(surfel.point);
    const float of_pixels = std::max(surfel.tilt_variance / independent, least);
    surfel.tilt_variance = distance * distance * of_pixels / tangent_scale_;
  }
}

/// A cell is too small for a good normal. Where its neighbours continue its surface, the plane
/// through all their points (again: inverse depth linear in the ray) has a slope several times more
/// certain.
void DepthCloud::smooth_normals() {
  smoothed_.clear();
  rays_.assign(surfels_.size(), Eigen::Vector3f::Zero());
  for (const std::uint32_t cell : valid_) {
    const Eigen::Vector3f& point = surfels_[cell].point;
    rays_[cell] << point.head<2>() / point.z(), 1.0F / point.z();
  }
  for (const std::uint32_t cell : valid_) {
    smoothed_.push_back(smoothed_normal(cell));
  }
  for (std::size_t i = 0; i < valid_.size(); ++i) {
    Surfel& surfel = surfels_[valid_[i]];
    surfel.normal = smoothed_[i].head<3>();
    surfel.tilt_variance = smoothed_[i].w();
    // With the plane at distance d, a change e of inverse depth moves it by z d e along its normal.
    const float moved = surfel.point.z() * surfel.normal.dot(surfel.point) * sigma_;
    surfel.normal_variance = moved * moved;
  }
}

/// By the smoothed normal: a cell's own is so uncertain that, near the limit, it would choose cells
/// by their errors.
void DepthCloud::drop_grazing() {
  for (const std::uint32_t cell : valid_) {
    const Surfel& surfel = surfels_[cell];
    if (-surfel.normal.dot(surfel.point) < min_cosine_ * surfel.point.norm()) {
      surfels_[cell].normal_variance = 0;
    }
  }
  std::erase_if(valid_, [this](std::uint32_t cell) { return !surfels_[cell].valid(); });
}

Eigen::Vector4f DepthCloud::smoothed_normal(std::uint32_t cell) const noexcept {
  constexpr int kRings = 3;
  const Surfel& centre = surfels_[cell];
  Eigen::Vector4f best{centre.normal.x(), centre.normal.y(), centre.normal.z(),
                       centre.tilt_variance};
  const float q0 = rays_[cell].z();
  const Eigen::Vector2f ray0 = rays_[cell].head<2>();
  Eigen::Vector2f slope = centre.normal.head<2>() / centre.normal.dot(centre.point);
  const auto enough = static_cast<float>(config_.normal_sigma_rad * config_.normal_sigma_rad);
  PlaneFit plane;
  const auto add_if_it_continues = [&](int index) {
    const Eigen::Vector3f& other = rays_[static_cast<std::size_t>(index)];
    const Eigen::Vector2f ray = other.head<2>() - ray0;
    const float q = other.z() - q0;
    if (other.z() > 0 && std::abs(q - slope.dot(ray)) <= kNeighbourSigmas * sigma_) {
      plane.add(ray, q);
    }
  };
  add_if_it_continues(static_cast<int>(cell));
  // Cells at the limit of incidence are chosen by their normal's error where that is large.
  constexpr float kCertainSigmas = 3.0F;
  const Eigen::Vector3f towards_camera = -centre.point.normalized();
  const auto certain = [&] {
    const float from_limit = best.head<3>().dot(towards_camera) - min_cosine_;
    return best.w() <= enough &&
           from_limit * from_limit > kCertainSigmas * kCertainSigmas * best.w();
  };
  for (int ring = 1; ring <= kRings && !certain(); ++ring) {
    for_each_in_ring(*grid_, cell, ring, add_if_it_continues);
    PlaneFit fitted = plane;
    if (!fitted.solve() ||
        fitted.squares > kMisfit * (fitted.count - kParameters) * sigma_ * sigma_) {
      break;  // alone, curved, or a fold
    }
    slope = fitted.slope;
    const Eigen::Vector3f normal{slope.x(), slope.y(), q0 - slope.dot(ray0)};
    const float z2 = centre.point.z() * centre.point.z();
    best.head<3>() = -normal.normalized();
    const float moved = centre.point.z() * best.head<3>().dot(centre.point) * sigma_;
    best.w() = std::min(best.w(), moved * moved / (z2 * fitted.spread.minCoeff()));
  }
  return best;
}

}  // namespace geoflow::slam
