#pragma once

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

/// The colour camera's geometry. Two kinds of pixel coordinates: *raw* ones, where the image has
/// them, and *ideal* ones, where an undistorted pinhole camera of the same focal lengths and centre
/// would have them. Images are read at raw pixels; all estimation is done in ideal pixels.
namespace geoflow::slam {

/// Pure after construction, thread-safe.
class CameraModel {
 public:
  explicit CameraModel(const CameraIntrinsics& intrinsics) : k_{intrinsics} {}

  [[nodiscard]] const CameraIntrinsics& intrinsics() const noexcept { return k_; }

  /// Ideal pixel of a point in the camera frame [m]; precondition: p_cam.z() > 0. Paper, equation
  /// (2).
  [[nodiscard]] Vector2d project(const Vector3d& p_cam) const noexcept {
    return {k_.fx * p_cam.x() / p_cam.z() + k_.cx, k_.fy * p_cam.y() / p_cam.z() + k_.cy};
  }

  /// Derivative of project() by the point, 2 x 3 [px/m].
  [[nodiscard]] Eigen::Matrix<double, 2, 3> project_jacobian(const Vector3d& p_cam) const noexcept;

  /// Point at depth z [m] on the ray of an ideal pixel, in the camera frame.
  [[nodiscard]] Vector3d unproject(const Vector2d& ideal, double depth_m) const noexcept {
    return {(ideal.x() - k_.cx) / k_.fx * depth_m, (ideal.y() - k_.cy) / k_.fy * depth_m, depth_m};
  }

  [[nodiscard]] Vector2d distort(const Vector2d& ideal) const noexcept;
  /// Inverse of distort() by fixed-point iteration, to 1e-6 px for lenses whose model is invertible
  /// in the image.
  [[nodiscard]] Vector2d undistort(const Vector2d& raw) const noexcept;

  /// Whether a raw pixel lies inside the image by at least `border` pixels.
  [[nodiscard]] bool contains(const Vector2d& raw, double border) const noexcept {
    return raw.x() >= border && raw.y() >= border && raw.x() <= k_.width - 1 - border &&
           raw.y() <= k_.height - 1 - border;
  }

 private:
  CameraIntrinsics k_;
};

}  // namespace geoflow::slam
