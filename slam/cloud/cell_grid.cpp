#include "cloud/cell_grid.hpp"

#include <cmath>
#include <cstddef>
#include <memory>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::slam {
namespace {

constexpr int kMinCellPx = 2;
constexpr int kMaxCellPx = 64;
constexpr int kMaxImagePx = 1 << 14;

using Coefficients = decltype(CameraIntrinsics::distortion);

/// Brown-Conrady, as OpenCV and Kalibr write it: k1 k2 p1 p2 k3.
Eigen::Vector2d radtan(const Coefficients& k, const Eigen::Vector2d& ray) {
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  return {x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
          y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y};
}

/// Kannala-Brandt with four coefficients.
Eigen::Vector2d equidistant(const Coefficients& k, const Eigen::Vector2d& ray) {
  constexpr double kOnAxis = 1e-9;
  const double r = ray.norm();
  if (r < kOnAxis) {
    return ray;
  }
  const double theta = std::atan(r);
  const double t2 = theta * theta;
  return ray * (theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r);
}

Eigen::Vector2d distort_ray(const CameraIntrinsics& camera, const Eigen::Vector2d& ray) {
  switch (camera.model) {
    case DistortionModel::kRadtan:
      return radtan(camera.distortion, ray);
    case DistortionModel::kEquidistant:
      return equidistant(camera.distortion, ray);
    case DistortionModel::kNone:
      break;
  }
  return ray;
}

/// d(distorted)/d(ray) by central differences: exact enough for a table that is made once.
Eigen::Matrix2d distortion_jacobian(const CameraIntrinsics& camera, const Eigen::Vector2d& ray) {
  constexpr double kStep = 1e-5;
  Eigen::Matrix2d jacobian;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
    jacobian.col(axis) =
        (distort_ray(camera, ray + step) - distort_ray(camera, ray - step)) / (2.0 * kStep);
  }
  return jacobian;
}

/// The ray whose distorted image is `distorted`, by Newton's method from the image itself.
Eigen::Vector2d undistort_ray(const CameraIntrinsics& camera, const Eigen::Vector2d& distorted) {
  constexpr int kIterations = 10;
  Eigen::Vector2d ray = distorted;
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::Vector2d error = distort_ray(camera, ray) - distorted;
    ray -= distortion_jacobian(camera, ray).inverse() * error;
  }
  return ray;
}

}  // namespace

Result<std::shared_ptr<const CellGrid>> CellGrid::create(const CameraIntrinsics& camera,
                                                         int cell_px) {
  if (cell_px < kMinCellPx || cell_px > kMaxCellPx) {
    return fail(ErrorCode::kInvalidArgument, "depth cells of {} px: {} to {} are possible", cell_px,
                kMinCellPx, kMaxCellPx);
  }
  if (camera.width < cell_px || camera.height < cell_px || camera.width > kMaxImagePx ||
      camera.height > kMaxImagePx) {
    return fail(ErrorCode::kInvalidArgument,
                "a depth image of {} x {} px has no whole cell of {} px or is too large",
                camera.width, camera.height, cell_px);
  }
  if (!(camera.fx > 0.0) || !(camera.fy > 0.0) ||
      !std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy)) {
    return fail(ErrorCode::kInvalidArgument,
                "depth camera with focal lengths {}, {} and centre {}, {}", camera.fx, camera.fy,
                camera.cx, camera.cy);
  }
  struct Constructible : CellGrid {
    Constructible(const CameraIntrinsics& intrinsics, int px) : CellGrid{intrinsics, px} {}
  };
  auto grid = std::make_shared<Constructible>(camera, cell_px);
  for (const Ray& ray : grid->rays_) {
    if (!ray.centre.allFinite() || !ray.per_pixel.allFinite()) {
      return fail(ErrorCode::kInvalidArgument,
                  "the depth camera's distortion cannot be undone over the whole image");
    }
  }
  return grid;
}

CellGrid::CellGrid(const CameraIntrinsics& camera, int cell_px)
    : camera_{camera},
      cell_px_{cell_px},
      columns_{camera.width / cell_px},
      rows_{camera.height / cell_px},
      distorted_{camera.model != DistortionModel::kNone},
      scale_{static_cast<float>(camera.fx / cell_px), static_cast<float>(camera.fy / cell_px)},
      offset_{static_cast<float>((camera.cx + 0.5) / cell_px),
              static_cast<float>((camera.cy + 0.5) / cell_px)} {
  if (camera.model == DistortionModel::kRadtan) {
    distorted_ = camera.distortion != Coefficients{};
  }
  rays_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  const double to_middle = 0.5 * (cell_px - 1);
  const Eigen::Vector2d focal{camera.fx, camera.fy};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d pixel{column * cell_px + to_middle, row * cell_px + to_middle};
      const Eigen::Vector2d distorted =
          (pixel - Eigen::Vector2d{camera.cx, camera.cy}).cwiseQuotient(focal);
      const Eigen::Vector2d ray = distorted_ ? undistort_ray(camera, distorted) : distorted;
      const Eigen::Matrix2d per_ray =
          distorted_ ? distortion_jacobian(camera, ray) : Eigen::Matrix2d::Identity();
      Ray& entry = rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                         static_cast<std::size_t>(column)];
      entry.centre = ray.cast<float>();
      entry.per_pixel = (focal.asDiagonal() * per_ray).inverse().cast<float>();
    }
  }
}

Eigen::Vector2f CellGrid::distort(const Eigen::Vector2f& ray) const noexcept {
  return distort_ray(camera_, ray.cast<double>()).cast<float>();
}

}  // namespace geoflow::slam
