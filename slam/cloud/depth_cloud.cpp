#include "cloud/depth_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "cloud/cell_grid.hpp"

namespace geoflow::slam {
namespace {

/// What is summed over the rows of a cell, for each image column. q: inverse depth less the
/// column's reference; v: row less the cell's middle row; only pixels with depth count.
enum Column : std::size_t { kReference, kCount, kV, kVV, kQ, kQV, kQQ, kMask, kRowQ, kColumnSums };

/// A square of side s has variance s^2 / 12 about its middle.
constexpr double kSquareVariance = 12.0;
constexpr double kDegree = std::numbers::pi / 180.0;
/// Least determinant of a cell's pixels' scatter, relative to its diagonal.
constexpr double kMinPixelSpread = 1e-3;
constexpr double kPlaneParameters = 3.0;

/// A neighbour belongs to a cell's surface when it is within this many sigmas of a pixel from the
/// cell's own plane, whose slope is uncertain; the joint fit decides.
constexpr float kNeighbourSigmas = 4.0F;
/// Cells, the middle one included, that a joint plane takes.
constexpr float kMinNeighbourhood = 5.0F;
/// Least determinant of the cells' scatter, relative to its diagonal: they must not lie on one
/// line.
constexpr float kMinSpread = 0.05F;

/// Depth that is used [counts], and counts of 1 / (1 m).
struct DepthLimits {
  std::int32_t min;
  std::int32_t max;
  float per_inverse_metre;
};

constexpr int kSignBit = 31;

// These three loops are over all pixels, and vectorised: no branch, and arrays that are told not to
// overlap.

void convert(const std::uint16_t* __restrict pixels, std::size_t width, const DepthLimits& limits,
             const float* __restrict reference, float* __restrict mask, float* __restrict q) {
  const auto [min, max, scale] = limits;
  for (std::size_t x = 0; x < width; ++x) {
    const std::int32_t counts = pixels[x];
    // All ones where neither difference is negative; comparisons would become branches.
    const std::int32_t inside = ~((counts - min) | (max - counts)) >> kSignBit;
    const auto usable = static_cast<float>(inside & 1);
    const auto divisor = static_cast<float>(counts | (1 & ~inside));  // never 0
    mask[x] = usable;
    q[x] = usable * (scale / divisor - reference[x]);
  }
}

void add_mask(const float* __restrict mask, std::size_t width, float v, float* __restrict count,
              float* __restrict sum_v, float* __restrict sum_vv) {
  for (std::size_t x = 0; x < width; ++x) {
    count[x] += mask[x];
    sum_v[x] += mask[x] * v;
    sum_vv[x] += mask[x] * (v * v);
  }
}

void add_inverse_depth(const float* __restrict q, std::size_t width, float v,
                       float* __restrict sum_q, float* __restrict sum_qv,
                       float* __restrict sum_qq) {
  for (std::size_t x = 0; x < width; ++x) {
    sum_q[x] += q[x];
    sum_qv[x] += q[x] * v;
    sum_qq[x] += q[x] * q[x];
  }
}

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

}  // namespace

/// The same sums over one cell, with u: column less the cell's middle column.
struct DepthCloud::Sums {
  float reference = 0;
  float n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  float q = 0, qu = 0, qv = 0, qq = 0;
};

DepthCloud::DepthCloud(std::shared_ptr<const CellGrid> grid, double depth_unit_m,
                       const DepthCloudConfig& config)
    : grid_{std::move(grid)},
      config_{config},
      unit_m_{static_cast<float>(depth_unit_m)},
      tangent_scale_{
          static_cast<float>(grid_->cell_px() * grid_->cell_px() /
                             (kSquareVariance * grid_->camera().fx * grid_->camera().fy))},
      min_cosine_{static_cast<float>(std::cos(config.max_incidence_deg * kDegree))} {
  config_.cell_px = grid_->cell_px();
  surfels_.resize(grid_->size());
  valid_.reserve(grid_->size());
  smoothed_.reserve(grid_->size());
  columns_.resize(kColumnSums * static_cast<std::size_t>(grid_->columns() * grid_->cell_px()));
}

Result<void> DepthCloud::build(const FrameRef& depth) {
  valid_.clear();
  std::ranges::fill(surfels_, Surfel{});
  const CameraIntrinsics& camera = grid_->camera();
  if (!depth) {
    return fail(ErrorCode::kInvalidArgument, "depth cloud: no image");
  }
  if (depth.shape() !=
      ImageShape{.width = camera.width, .height = camera.height, .format = PixelFormat::kDepth16}) {
    return fail(ErrorCode::kInvalidArgument,
                "depth cloud: an image of {} x {} px is not the camera's 16-bit depth of {} x {}",
                depth.shape().width, depth.shape().height, camera.width, camera.height);
  }
  for (int row = 0; row < grid_->rows(); ++row) {
    accumulate_row_of_cells(depth, row);
    for (int column = 0; column < grid_->columns(); ++column) {
      const auto cell = static_cast<std::uint32_t>(row * grid_->columns() + column);
      surfels_[cell] = fit(sums_of_cell(column), grid_->ray(cell));
      if (surfels_[cell].valid()) {
        valid_.push_back(cell);
      }
    }
  }
  smooth_normals();
  return {};
}

void DepthCloud::accumulate_row_of_cells(const FrameRef& depth, int cell_row) {
  const int px = grid_->cell_px();
  const std::size_t width =
      static_cast<std::size_t>(grid_->columns()) * static_cast<std::size_t>(px);
  std::ranges::fill(columns_, 0.0F);
  float* const reference = columns_.data() + kReference * width;
  float* const count = columns_.data() + kCount * width;
  float* const sum_v = columns_.data() + kV * width;
  float* const sum_vv = columns_.data() + kVV * width;
  float* const sum_q = columns_.data() + kQ * width;
  float* const sum_qv = columns_.data() + kQV * width;
  float* const sum_qq = columns_.data() + kQQ * width;
  const float to_counts = 1.0F / unit_m_;
  float* const mask = columns_.data() + kMask * width;
  float* const q = columns_.data() + kRowQ * width;
  const auto to_int = [&](double depth_m) {
    constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
    return static_cast<std::int32_t>(
        std::clamp(depth_m * static_cast<double>(to_counts), 1.0, kMost));
  };
  const DepthLimits limits{.min = to_int(config_.min_depth_m),
                           .max = to_int(config_.max_depth_m),
                           .per_inverse_metre = to_counts};

  // A reference near the cell's own inverse depth keeps the squares' digits in single precision.
  const auto* const middle = depth.row<std::uint16_t>(cell_row * px + px / 2);
  for (int column = 0; column < grid_->columns(); ++column) {
    const int first = column * px;
    const auto* const seen =
        std::find_if(middle + first, middle + first + px, [](std::uint16_t d) { return d != 0; });
    if (seen != middle + first + px) {
      std::fill_n(reference + first, px, to_counts / static_cast<float>(*seen));
    }
  }
  for (int i = 0; i < px; ++i) {
    const auto* const pixels = depth.row<std::uint16_t>(cell_row * px + i);
    const float v = static_cast<float>(i) - 0.5F * static_cast<float>(px - 1);
    convert(pixels, width, limits, reference, mask, q);
    add_mask(mask, width, v, count, sum_v, sum_vv);
    add_inverse_depth(q, width, v, sum_q, sum_qv, sum_qq);
  }
}

DepthCloud::Sums DepthCloud::sums_of_cell(int column) const noexcept {
  const int px = grid_->cell_px();
  const std::size_t width =
      static_cast<std::size_t>(grid_->columns()) * static_cast<std::size_t>(px);
  const float* const first = columns_.data() + static_cast<std::ptrdiff_t>(column) * px;
  const auto at = [&](Column sum, int i) {
    return first[sum * width + static_cast<std::size_t>(i)];
  };
  Sums sums;
  sums.reference = at(kReference, 0);
  for (int i = 0; i < px; ++i) {
    const float u = static_cast<float>(i) - 0.5F * static_cast<float>(px - 1);
    const float n = at(kCount, i);
    const float q = at(kQ, i);
    sums.n += n;
    sums.u += n * u;
    sums.v += at(kV, i);
    sums.uu += n * u * u;
    sums.uv += at(kV, i) * u;
    sums.vv += at(kVV, i);
    sums.q += q;
    sums.qu += q * u;
    sums.qv += at(kQV, i);
    sums.qq += at(kQQ, i);
  }
  return sums;
}

Surfel DepthCloud::fit(const Sums& sums, const CellGrid::Ray& ray) const noexcept {
  const auto wide = [](float value) { return static_cast<double>(value); };
  const double n = wide(sums.n);
  if (n < config_.min_fill * grid_->cell_px() * grid_->cell_px()) {
    return {};
  }
  // A plane's inverse depth is linear in the image: q = mean + slope . (u, v), fitted about the
  // pixels' centroid.
  const double u = wide(sums.u) / n;
  const double v = wide(sums.v) / n;
  const double q = wide(sums.q) / n;
  const double uu = wide(sums.uu) - n * u * u;
  const double uv = wide(sums.uv) - n * u * v;
  const double vv = wide(sums.vv) - n * v * v;
  const double qu = wide(sums.qu) - n * q * u;
  const double qv = wide(sums.qv) - n * q * v;
  const double determinant = uu * vv - uv * uv;
  if (determinant <= kMinPixelSpread * uu * vv) {
    return {};
  }
  const Eigen::Vector2d slope{(vv * qu - uv * qv) / determinant, (uu * qv - uv * qu) / determinant};
  const double squares = wide(sums.qq) - n * q * q - slope.x() * qu - slope.y() * qv;
  const double variance = std::max(squares, 0.0) / std::max(n - kPlaneParameters, 1.0);
  const double sigma2 = config_.inverse_depth_sigma * config_.inverse_depth_sigma;
  if (variance > config_.max_plane_rms * config_.max_plane_rms * sigma2) {
    return {};
  }
  // A plane n . X = 1 has q = n . ray: n is (g, q - g . ray) with g the slope of q in the ray's
  // coordinates. A change e of q moves the point by z e / |n| along the normal.
  const Eigen::Vector2d at =
      ray.centre.cast<double>() + ray.per_pixel.cast<double>() * Eigen::Vector2d{u, v};
  const double inverse_depth = q + wide(sums.reference);
  const Eigen::Vector2d g = ray.per_pixel.cast<double>().inverse().transpose() * slope;
  const Eigen::Vector3d plane{g.x(), g.y(), inverse_depth - g.dot(at)};
  const double norm = plane.norm();
  const double z = 1.0 / inverse_depth;
  if (inverse_depth < static_cast<double>(min_cosine_) * norm * std::sqrt(1.0 + at.squaredNorm())) {
    return {};
  }
  const double independent = std::max(1.0, n / config_.correlated_pixels);
  Surfel surfel;
  surfel.point = (z * at.homogeneous()).cast<float>();
  surfel.normal = (-plane / norm).cast<float>();
  surfel.normal_variance =
      static_cast<float>(z * z * std::max(variance, sigma2) / (norm * norm * independent));
  surfel.tilt_variance =
      surfel.normal_variance / (tangent_scale_ * surfel.point.z() * surfel.point.z());
  return surfel;
}

/// A cell is too small for a good normal. Where its neighbours continue its surface, the plane
/// through all their points (again: inverse depth linear in the ray) has a slope several times more
/// certain.
void DepthCloud::smooth_normals() {
  smoothed_.clear();
  for (const std::uint32_t cell : valid_) {
    smoothed_.push_back(smoothed_normal(cell));
  }
  for (std::size_t i = 0; i < valid_.size(); ++i) {
    surfels_[valid_[i]].normal = smoothed_[i].head<3>();
    surfels_[valid_[i]].tilt_variance = smoothed_[i].w();
  }
}

Eigen::Vector4f DepthCloud::smoothed_normal(std::uint32_t cell) const noexcept {
  const Surfel& centre = surfels_[cell];
  Eigen::Vector4f own{centre.normal.x(), centre.normal.y(), centre.normal.z(),
                      centre.tilt_variance};
  const float q0 = 1.0F / centre.point.z();
  const Eigen::Vector2f ray0 = q0 * centre.point.head<2>();
  const Eigen::Vector2f slope = centre.normal.head<2>() / centre.normal.dot(centre.point);
  const auto sigma = static_cast<float>(config_.inverse_depth_sigma);
  const int columns = grid_->columns();
  const int column = static_cast<int>(cell) % columns;
  const int row = static_cast<int>(cell) / columns;
  PlaneFit plane;
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, grid_->rows() - 1); ++r) {
    for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns - 1); ++c) {
      const Surfel& other =
          surfels_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(c)];
      if (!other.valid()) {
        continue;
      }
      const float other_q = 1.0F / other.point.z();
      const Eigen::Vector2f ray = other_q * other.point.head<2>() - ray0;
      if (std::abs(other_q - q0 - slope.dot(ray)) <= kNeighbourSigmas * sigma) {
        plane.add(ray, other_q - q0);
      }
    }
  }
  if (!plane.solve() ||
      plane.squares > (plane.count - static_cast<float>(kPlaneParameters)) * sigma * sigma) {
    return own;  // alone, curved, or a fold
  }
  const Eigen::Vector3f normal{plane.slope.x(), plane.slope.y(), q0 - plane.slope.dot(ray0)};
  const float z2 = centre.point.z() * centre.point.z();
  Eigen::Vector4f result;
  result.head<3>() = -normal.normalized();
  result.w() =
      std::min(centre.tilt_variance, centre.normal_variance / (z2 * plane.spread.minCoeff()));
  return result;
}

}  // namespace geoflow::slam
