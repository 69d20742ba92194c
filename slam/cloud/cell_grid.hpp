#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::slam {

/// The depth image cut into square cells, and the camera's rays through them. Immutable after
/// create(), so it may be shared between threads; all clouds of one camera share one.
class CellGrid {
 public:
  /// The ray of a cell's middle (x, y at z = 1) and its change over one pixel. Within one cell the
  /// distortion is linear to far below a pixel.
  struct Ray {
    Eigen::Vector2f centre;     ///< at the middle of the cell's pixels
    Eigen::Matrix2f per_pixel;  ///< d(x, y)/d(u, v) [1/px]
  };

  /// Cells of `cell_px` x `cell_px` pixels; pixels beyond the last whole cell are not used.
  /// kInvalidArgument when the camera's size, focal length or the cell size makes no sense.
  [[nodiscard]] static Result<std::shared_ptr<const CellGrid>> create(
      const CameraIntrinsics& camera, int cell_px);

  [[nodiscard]] int cell_px() const noexcept { return cell_px_; }
  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] std::size_t size() const noexcept { return rays_.size(); }
  [[nodiscard]] const CameraIntrinsics& camera() const noexcept { return camera_; }
  [[nodiscard]] const Ray& ray(std::size_t cell) const noexcept { return rays_[cell]; }

  /// The cell into which a point of the camera frame [m] projects; none behind the camera or
  /// outside of the grid.
  [[nodiscard]] std::optional<Eigen::Vector2i> project(
      const Eigen::Vector3f& point) const noexcept {
    constexpr float kMinDepthM = 0.01F;
    if (!(point.z() > kMinDepthM)) {
      return std::nullopt;
    }
    const float inverse_z = 1.0F / point.z();
    Eigen::Vector2f ray{point.x() * inverse_z, point.y() * inverse_z};
    if (distorted_) {
      ray = distort(ray);
    }
    const float column = ray.x() * scale_.x() + offset_.x();
    const float row = ray.y() * scale_.y() + offset_.y();
    if (!(column >= 0.0F && row >= 0.0F && column < static_cast<float>(columns_) &&
          row < static_cast<float>(rows_))) {
      return std::nullopt;
    }
    return Eigen::Vector2i{static_cast<int>(column), static_cast<int>(row)};
  }

 private:
  CellGrid(const CameraIntrinsics& camera, int cell_px);
  [[nodiscard]] Eigen::Vector2f distort(const Eigen::Vector2f& ray) const noexcept;

  CameraIntrinsics camera_;
  int cell_px_;
  int columns_;
  int rows_;
  bool distorted_;
  Eigen::Vector2f scale_;   ///< ray to cell coordinates
  Eigen::Vector2f offset_;  ///< cell coordinates of the principal point
  std::vector<Ray> rays_;
};

}  // namespace geoflow::slam
