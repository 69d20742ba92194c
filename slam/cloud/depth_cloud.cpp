#include "cloud/depth_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "cloud/cell_grid.hpp"

namespace geoflow::slam {
namespace {

/// What is summed over the rows of a cell, for each image column. q: inverse depth less the
/// column's reference; v: row less the cell's middle row; only pixels with depth count. The steps
/// are those of q to the next pixel in its row and in its column, without their sign.
enum Column : std::size_t {
  kReference,
  kCount,
  kV,
  kVV,
  kQ,
  kQV,
  kQQ,
  kStepsAlong,
  kStepsDown,
  kCountAlong,
  kCountDown,
  kMask,
  kRowQ,
  kMaskAbove,
  kRowQAbove,
  kColumnSums
};

/// A square of side s has variance s^2 / 12 about its middle.
constexpr double kSquareVariance = 12.0;
constexpr double kDegree = std::numbers::pi / 180.0;
/// Least determinant of a cell's pixels' scatter, relative to its diagonal.
constexpr double kMinPixelSpread = 1e-3;
constexpr double kPlaneParameters = 3.0;
/// Cosine of incidence: a cell that seems to be seen edge on is no piece of a surface.
constexpr double kEdgeOn = 0.0175;

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

/// As convert() writes it.
struct ConvertedRow {
  const float* mask;
  const float* q;
};

/// Between each pixel and the other one at the same place of its row.
void add_steps(const ConvertedRow& row, const ConvertedRow& other, std::size_t width,
               float* __restrict steps, float* __restrict count) {
  const float* __restrict mask = row.mask;
  const float* __restrict q = row.q;
  const float* __restrict other_mask = other.mask;
  const float* __restrict other_q = other.q;
  for (std::size_t x = 0; x < width; ++x) {
    const float both = mask[x] * other_mask[x];
    steps[x] += both * std::abs(other_q[x] - q[x]);
    count[x] += both;
  }
}

}  // namespace

/// The same sums over one cell, with u: column less the cell's middle column.
struct DepthCloud::Sums {
  float reference = 0;
  float n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  float q = 0, qu = 0, qv = 0, qq = 0;
  float steps_along = 0, steps_down = 0, count_along = 0, count_down = 0;

  /// By how much the nearest of two neighbours is nearer than their mean, along and down: half the
  /// mean step. 0 unless the steps were summed.
  [[nodiscard]] float nearest_bias() const noexcept {
    return 0.5F *
           (steps_along / std::max(count_along, 1.0F) + steps_down / std::max(count_down, 1.0F));
  }
};

DepthCloud::DepthCloud(std::shared_ptr<const CellGrid> grid, const Pixels& pixels,
                       const DepthCloudConfig& config)
    : grid_{std::move(grid)},
      config_{config},
      pixels_{pixels},
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

std::shared_ptr<const DepthCloud> DepthCloud::restored(std::shared_ptr<const CellGrid> grid,
                                                       const Pixels& pixels, float sigma,
                                                       std::span<const Stored> surfels) {
  auto cloud = std::make_shared<DepthCloud>(std::move(grid), pixels, DepthCloudConfig{});
  cloud->sigma_ = sigma;
  for (const Stored& stored : surfels) {
    cloud->surfels_[stored.cell] = stored.surfel;
    cloud->valid_.push_back(stored.cell);
  }
  return cloud;
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
  drop_edges();
  measure_noise();
  smooth_normals();
  drop_grazing();
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
  const auto to_counts = static_cast<float>(1.0 / pixels_.unit_m);
  float* mask = columns_.data() + kMask * width;
  float* q = columns_.data() + kRowQ * width;
  float* mask_above = columns_.data() + kMaskAbove * width;
  float* q_above = columns_.data() + kRowQAbove * width;
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
    if (pixels_.alignment == DepthAlignment::kNearestTouching) {
      const ConvertedRow row{.mask = mask, .q = q};
      add_steps(row, {.mask = mask + 1, .q = q + 1}, width - 1,
                columns_.data() + kStepsAlong * width, columns_.data() + kCountAlong * width);
      if (i > 0) {
        add_steps(row, {.mask = mask_above, .q = q_above}, width,
                  columns_.data() + kStepsDown * width, columns_.data() + kCountDown * width);
      }
      std::swap(mask, mask_above);
      std::swap(q, q_above);
    }
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
    sums.steps_down += at(kStepsDown, i);
    sums.count_down += at(kCountDown, i);
    if (i + 1 < px) {  // the last one's neighbour has another reference
      sums.steps_along += at(kStepsAlong, i);
      sums.count_along += at(kCountAlong, i);
    }
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
  // A plane n . X = 1 has q = n . ray: n is (g, q - g . ray) with g the slope of q in the ray's
  // coordinates. A change e of q moves the point by z e / |n| along the normal.
  const Eigen::Vector2d at =
      ray.centre.cast<double>() + ray.per_pixel.cast<double>() * Eigen::Vector2d{u, v};
  const double inverse_depth = q + wide(sums.reference) - wide(sums.nearest_bias());
  const Eigen::Vector2d g = ray.per_pixel.cast<double>().inverse().transpose() * slope;
  const Eigen::Vector3d plane{g.x(), g.y(), inverse_depth - g.dot(at)};
  const double norm = plane.norm();
  const double z = 1.0 / inverse_depth;
  if (inverse_depth < kEdgeOn * norm * std::sqrt(1.0 + at.squaredNorm())) {
    return {};
  }
  Surfel surfel;
  surfel.point = (z * at.homogeneous()).cast<float>();
  surfel.normal = (-plane / norm).cast<float>();
  // Until smooth_normals() and measure_noise(): valid, and the pixels' variance about their plane.
  surfel.normal_variance = 1;
  surfel.tilt_variance =
      static_cast<float>(std::max(squares, 0.0) / std::max(n - kPlaneParameters, 1.0));
  return surfel;
}

}  // namespace geoflow::slam
