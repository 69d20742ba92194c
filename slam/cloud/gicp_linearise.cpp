#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include "geoflow/hal/geometry.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "cloud/gicp_internal.hpp"

namespace geoflow::slam {
namespace {

/// Source surfels summed in one go: the fixed partition that makes sums independent of the number
/// of threads.
constexpr std::size_t kChunk = 512;
/// Most chunks of one call: a grid of more surfels takes longer chunks.
constexpr std::size_t kMaxChunks = 64;

using Vector8f = Eigen::Matrix<float, 8, 1>;
using Matrix8f = Eigen::Matrix<float, 8, 8>;

/// Sums over one chunk. `system` is the sum of w (J, r, 0) (J, r, 0)^T, `noise` of w tau^2 (p, 1)
/// (p, 1)^T.
struct Partial {
  Matrix8f system = Matrix8f::Zero();
  Eigen::Matrix4f noise = Eigen::Matrix4f::Zero();
  double cost = 0;
  double squared_error = 0;
  double squared_error_m2 = 0;
  double weight = 0;
  std::size_t inliers = 0;
};

/// What a chunk needs of the whole problem, in single precision.
struct Problem {
  Problem(const DepthCloud& source_cloud, const DepthCloud& target_cloud,
          const SE3& T_target_source, const GicpStage& stage, const GicpConfig& config)
      : source{source_cloud.surfels()},
        target{target_cloud.surfels()},
        grid{target_cloud.grid()},
        R{T_target_source.rotation_matrix().cast<float>()},
        t{T_target_source.translation().cast<float>()},
        max_distance2{static_cast<float>(stage.max_distance_m * stage.max_distance_m)},
        extra_variance{static_cast<float>(stage.misalignment_m * stage.misalignment_m)},
        min_cosine{static_cast<float>(config.min_normal_cosine)},
        inverse_kernel2{static_cast<float>(1.0 / (config.kernel_sigmas * config.kernel_sigmas))},
        source_tangent{source_cloud.tangent_scale()},
        target_tangent{target_cloud.tangent_scale()},
        search{stage.search_cells} {}

  std::span<const Surfel> source;
  std::span<const Surfel> target;
  const CellGrid& grid;
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
  float max_distance2;
  float extra_variance;
  float min_cosine;
  float inverse_kernel2;
  float source_tangent;  ///< variance within a surfel's surface at z = 1 m
  float target_tangent;
  int search;
};

/// The surfel of `cell` if it may be paired with the source surfel at `point` with `normal` (in the
/// target's frame).
const Surfel* acceptable(const Problem& problem, int cell, const Eigen::Vector3f& point,
                         const Eigen::Vector3f& normal, float& distance2) {
  const Surfel& candidate = problem.target[static_cast<std::size_t>(cell)];
  if (!candidate.valid() || candidate.normal.dot(normal) < problem.min_cosine) {
    return nullptr;
  }
  const float d2 = (point - candidate.point).squaredNorm();
  if (d2 >= distance2) {
    return nullptr;
  }
  distance2 = d2;
  return &candidate;
}

/// The acceptable surfel of the projected cell, else the nearest one of its neighbours; null if
/// there is none.
const Surfel* associate(const Problem& problem, const Eigen::Vector3f& point,
                        const Eigen::Vector3f& normal) {
  const auto cell = problem.grid.project(point);
  if (!cell) {
    return nullptr;
  }
  const int columns = problem.grid.columns();
  const Surfel* best = nullptr;
  float distance2 = problem.max_distance2;
  const int middle = cell->y() * columns + cell->x();
  if (const Surfel* const hit = acceptable(problem, middle, point, normal, distance2)) {
    return hit;
  }
  const int first_row = std::max(cell->y() - problem.search, 0);
  const int last_row = std::min(cell->y() + problem.search, problem.grid.rows() - 1);
  const int first_column = std::max(cell->x() - problem.search, 0);
  const int last_column = std::min(cell->x() + problem.search, columns - 1);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      const int index = row * columns + column;
      if (const Surfel* const candidate = acceptable(problem, index, point, normal, distance2)) {
        best = candidate;
      }
    }
  }
  return best;
}

/// Adds the pair of `source` with its associate, if it has one. Equations: docs/gicp.md.
void add(const Problem& problem, const Surfel& source, float sample_weight, Partial& partial) {
  const Eigen::Vector3f& p = source.point;
  const Eigen::Vector3f point = problem.R * p + problem.t;
  const Eigen::Vector3f normal = problem.R * source.normal;
  const Surfel* const target = associate(problem, point, normal);
  if (target == nullptr) {
    return;
  }
  const float cosine = target->normal.dot(normal);
  const Eigen::Vector3f common = (target->normal + normal) / std::sqrt(2.0F + 2.0F * cosine);
  const float residual = common.dot(point - target->point);
  // n^T C n with n half-way between the normals: cos^2 and sin^2 of half the angle between them.
  const float sine2 = std::max(0.0F, 0.5F * (1.0F - cosine));
  const float variance = (1.0F - sine2) * (source.normal_variance + target->normal_variance) +
                         sine2 * (problem.source_tangent * p.z() * p.z() +
                                  problem.target_tangent * target->point.z() * target->point.z()) +
                         problem.extra_variance;
  const float inverse_variance = 1.0F / variance;
  const float error2 = residual * residual * inverse_variance;
  const float excess = 1.0F + error2 * problem.inverse_kernel2;
  const float kernel = 1.0F / excess;  // Cauchy: rho(s) = k^2 log(1 + s / k^2)
  const float weight = sample_weight * kernel * inverse_variance;

  // The lever arm ends at the pair's most likely point, whose error and the residual's are
  // independent. With the source's own point they are not, and noise would turn into rotation.
  const float towards_target =
      source.normal_variance / (source.normal_variance + target->normal_variance);
  const Eigen::Vector3f x =
      p + towards_target * (problem.R.transpose() * (target->point - problem.t) - p);
  const Eigen::Vector3f m = problem.R.transpose() * common;
  Vector8f row;
  row << x.y() * m.z() - x.z() * m.y(), x.z() * m.x() - x.x() * m.z(),
      x.x() * m.y() - x.y() * m.x(), m.x(), m.y(), m.z(), residual, 0.0F;
  partial.system.noalias() += (weight * row) * row.transpose();
  const float tilt_variance = 0.25F * (source.tilt_variance + target->tilt_variance);
  const Eigen::Vector4f homogeneous = p.homogeneous();
  partial.noise.noalias() += (weight * tilt_variance * homogeneous) * homogeneous.transpose();
  partial.cost += static_cast<double>(sample_weight * std::log(excess) / problem.inverse_kernel2);
  partial.squared_error += static_cast<double>(sample_weight * kernel * error2);
  partial.squared_error_m2 += static_cast<double>(sample_weight * kernel * residual * residual);
  partial.weight += static_cast<double>(sample_weight * kernel);
  ++partial.inliers;
}

/// Sums `count` terms in fixed chunks on TBB's threads; `term(i, partial)` adds the i-th.
template <typename Term>
NormalEquations sum(std::size_t count, const Term& term) {
  std::array<Partial, kMaxChunks> partials;
  const std::size_t chunk = std::max(kChunk, (count + kMaxChunks - 1) / kMaxChunks);
  const std::size_t chunks = (count + chunk - 1) / chunk;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>{0, chunks, 1},
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
          const std::size_t end = std::min(count, (c + 1) * chunk);
          for (std::size_t i = c * chunk; i < end; ++i) {
            term(i, partials[c]);
          }
        }
      },
      tbb::simple_partitioner{});
  NormalEquations total;
  Eigen::Matrix4d noise = Eigen::Matrix4d::Zero();
  for (std::size_t c = 0; c < chunks; ++c) {
    const Partial& partial = partials[c];
    total.H += partial.system.topLeftCorner<6, 6>().cast<double>();
    total.b += partial.system.block<6, 1>(0, 6).cast<double>();
    noise += partial.noise.cast<double>();
    total.cost += 0.5 * partial.cost;
    total.squared_error += partial.squared_error;
    total.squared_error_m2 += partial.squared_error_m2;
    total.weight += partial.weight;
    total.inliers += partial.inliers;
  }
  const Matrix3d pp = noise.topLeftCorner<3, 3>();
  const Vector3d p = noise.topRightCorner<3, 1>();
  total.H_noise.topLeftCorner<3, 3>() = pp.trace() * Matrix3d::Identity() - pp;
  total.H_noise.topRightCorner<3, 3>() = skew(p);
  total.H_noise.bottomLeftCorner<3, 3>() = -skew(p);
  total.H_noise.bottomRightCorner<3, 3>() = noise(3, 3) * Matrix3d::Identity();
  return total;
}

}  // namespace

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  H += other.H;
  b += other.b;
  H_noise += other.H_noise;
  cost += other.cost;
  squared_error += other.squared_error;
  squared_error_m2 += other.squared_error_m2;
  weight += other.weight;
  inliers += other.inliers;
  return *this;
}

NormalEquations linearise_stage(const DepthCloud& source, const DepthCloud& target,
                                const SE3& T_target_source, const GicpStage& stage,
                                const GicpConfig& config) {
  const Problem problem{source, target, T_target_source, stage, config};
  const std::span<const std::uint32_t> cells = source.valid();
  const auto stride = static_cast<std::size_t>(std::max(stage.stride, 1));
  return sum((cells.size() + stride - 1) / stride, [&](std::size_t i, Partial& partial) {
    add(problem, problem.source[cells[i * stride]], 1.0F, partial);
  });
}

NormalEquations linearise(const DepthCloud& source, const DepthCloud& target,
                          const SE3& T_target_source, const GicpConfig& config) {
  return linearise_stage(source, target, T_target_source,
                         config.stages.empty() ? GicpStage{} : config.stages.back(), config);
}

NormalEquations linearise(const DepthCloud& source, std::span<const SurfelSample> sample,
                          const DepthCloud& target, const SE3& T_target_source,
                          const GicpConfig& config) {
  const Problem problem{source, target, T_target_source,
                        config.stages.empty() ? GicpStage{} : config.stages.back(), config};
  return sum(sample.size(), [&](std::size_t i, Partial& partial) {
    const Surfel& surfel = problem.source[sample[i].cell];
    if (surfel.valid()) {
      add(problem, surfel, sample[i].weight, partial);
    }
  });
}

}  // namespace geoflow::slam
