#include "cloud/depth_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace geoflow::slam {
namespace {

/// What is summed over the rows of a cell, for each image column. q: inverse depth less the
/// column's reference; v: row less the cell's middle row; only pixels with depth count.
enum Column : std::size_t { kReference, kCount, kV, kVV, kQ, kQV, kQQ, kColumnSums };

}  // namespace

/// The same sums over one cell, with u: column less the cell's middle column.
struct DepthCloud::Sums {
  double reference = 0;
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  double q = 0, qu = 0, qv = 0, qq = 0;
};

DepthCloud::DepthCloud(std::shared_ptr<const CellGrid> grid, double depth_unit_m,
                       const DepthCloudConfig& config)
    : grid_{std::move(grid)}, config_{config}, unit_m_{static_cast<float>(depth_unit_m)} {
  config_.cell_px = grid_->cell_px();
  surfels_.resize(grid_->size());
  valid_.reserve(grid_->size());
  columns_.resize(kColumnSums * static_cast<std::size_t>(grid_->columns() * grid_->cell_px()));
}

Result<void> DepthCloud::build(const FrameRef& depth) {
  valid_.clear();
  std::fill(surfels_.begin(), surfels_.end(), Surfel{});
  const CameraIntrinsics& camera = grid_->camera();
  if (!depth) {
    return fail(ErrorCode::kInvalidArgument, "depth cloud: no image");
  }
  if (depth.shape() != ImageShape{camera.width, camera.height, PixelFormat::kDepth16}) {
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
  return {};
}

void DepthCloud::accumulate_row_of_cells(const FrameRef& depth, int cell_row) {
  const int px = grid_->cell_px();
  const std::size_t width =
      static_cast<std::size_t>(grid_->columns()) * static_cast<std::size_t>(px);
  std::fill(columns_.begin(), columns_.end(), 0.0F);
  float* const reference = columns_.data() + kReference * width;
  float* const count = columns_.data() + kCount * width;
  float* const sum_v = columns_.data() + kV * width;
  float* const sum_vv = columns_.data() + kVV * width;
  float* const sum_q = columns_.data() + kQ * width;
  float* const sum_qv = columns_.data() + kQV * width;
  float* const sum_qq = columns_.data() + kQQ * width;
  const float to_counts = 1.0F / unit_m_;
  const float min_counts = static_cast<float>(config_.min_depth_m) * to_counts;
  const float max_counts = static_cast<float>(config_.max_depth_m) * to_counts;

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
    for (std::size_t x = 0; x < width; ++x) {
      const auto counts = static_cast<float>(static_cast<std::int32_t>(pixels[x]));
      const bool usable = counts >= min_counts && counts <= max_counts;
      const float mask = usable ? 1.0F : 0.0F;
      const float q = mask * (to_counts / std::max(counts, 1.0F) - reference[x]);
      count[x] += mask;
      sum_v[x] += mask * v;
      sum_vv[x] += mask * v * v;
      sum_q[x] += q;
      sum_qv[x] += q * v;
      sum_qq[x] += q * q;
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
  Eigen::Matrix<float, 10, 1> s = Eigen::Matrix<float, 10, 1>::Zero();
  for (int i = 0; i < px; ++i) {
    const float u = static_cast<float>(i) - 0.5F * static_cast<float>(px - 1);
    const float n = at(kCount, i);
    const float q = at(kQ, i);
    s[0] += n;
    s[1] += n * u;
    s[2] += at(kV, i);
    s[3] += n * u * u;
    s[4] += at(kV, i) * u;
    s[5] += at(kVV, i);
    s[6] += q;
    s[7] += q * u;
    s[8] += at(kQV, i);
    s[9] += at(kQQ, i);
  }
  return {.reference = at(kReference, 0),
          .n = s[0],
          .u = s[1],
          .v = s[2],
          .uu = s[3],
          .uv = s[4],
          .vv = s[5],
          .q = s[6],
          .qu = s[7],
          .qv = s[8],
          .qq = s[9]};
}

Surfel DepthCloud::fit(const Sums& sums, const CellGrid::Ray& ray) const noexcept {
  const double pixels = grid_->cell_px() * grid_->cell_px();
  if (sums.n < config_.min_fill * pixels) {
    return {};
  }
  // A plane's inverse depth is linear in the image: q = mean + slope . (u, v), fitted about the
  // pixels' centroid.
  const double u = sums.u / sums.n;
  const double v = sums.v / sums.n;
  const double q = sums.q / sums.n;
  const double uu = sums.uu - sums.n * u * u;
  const double uv = sums.uv - sums.n * u * v;
  const double vv = sums.vv - sums.n * v * v;
  const double qu = sums.qu - sums.n * q * u;
  const double qv = sums.qv - sums.n * q * v;
  const double determinant = uu * vv - uv * uv;
  if (determinant <= 1e-3 * uu * vv) {
    return {};
  }
  const Eigen::Vector2d slope{(vv * qu - uv * qv) / determinant, (uu * qv - uv * qu) / determinant};
  const double squares = sums.qq - sums.n * q * q - slope.x() * qu - slope.y() * qv;
  const double variance = std::max(squares, 0.0) / std::max(sums.n - 3.0, 1.0);
  const double sigma2 = config_.inverse_depth_sigma * config_.inverse_depth_sigma;
  if (variance > config_.max_plane_rms * config_.max_plane_rms * sigma2) {
    return {};
  }
  // q = (n . ray) / d: with slope per ray coordinate g, n is along (g, q - g . ray), d = 1 / |...|.
  const Eigen::Vector2d at =
      ray.centre.cast<double>() + ray.per_pixel.cast<double>() * Eigen::Vector2d{u, v};
  const double inverse_depth = q + sums.reference;
  const Eigen::Vector2d g = ray.per_pixel.cast<double>().inverse().transpose() * slope;
  const Eigen::Vector3d normal{g.x(), g.y(), inverse_depth - g.dot(at)};
  const double inverse_distance = normal.norm();
  const double z = 1.0 / inverse_depth;
  const double cosine = inverse_depth / (inverse_distance * std::sqrt(1.0 + at.squaredNorm()));
  if (cosine < std::cos(config_.max_incidence_deg * std::numbers::pi / 180.0)) {
    return {};
  }
  // Moving the inverse depth by e moves the point by z e / |n| along the unit normal.
  const double normal_sigma2 =
      z * z * std::max(variance, sigma2) / (inverse_distance * inverse_distance);
  const double side =
      grid_->cell_px() * z * std::sqrt(std::abs(ray.per_pixel.cast<double>().determinant()));
  Surfel surfel;
  surfel.point = (z * at.homogeneous()).cast<float>();
  surfel.normal = (-normal / inverse_distance).cast<float>();
  surfel.normal_variance =
      static_cast<float>(normal_sigma2 * std::min(1.0, config_.correlated_pixels / sums.n));
  surfel.tangent_variance = static_cast<float>(side * side / 12.0);
  return surfel;
}

}  // namespace geoflow::slam
