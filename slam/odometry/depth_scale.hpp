#pragma once

#include <optional>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {

/// What a depth camera errs by in all of its images alike makes each step too long or too short, by
/// as large a share of it as the surfaces seen are far away. No view tells it from a true scale, so
/// that it adds up along the way, and is taken back on the way back. Thread-compatible.
class DepthScale {
 public:
  /// Standard deviation of what is alike in all inverse depths [1/m]: a twentieth of a pixel of a
  /// D435's disparity at 640 x 480. Its datasheet allows two percent at 2 m at most, 1e-2.
  static constexpr double kSigma = 1.5e-3;

  /// The camera has gone to a place in odom; `cloud` is what it sees there, null: nothing.
  void follow(const Vector3d& p_odom_cam, const DepthCloud* cloud);
  /// The map has moved, and the camera in it; applied on the left.
  void move(const SE3& T_odom1_odom0);

  /// The covariance of the position in odom that comes of it [m^2].
  [[nodiscard]] Matrix3d covariance() const { return kSigma * kSigma * way_ * way_.transpose(); }

 private:
  std::optional<Vector3d> last_;
  double depth_m_ = 0;               ///< of the surfaces seen last: harmonic mean
  Vector3d way_ = Vector3d::Zero();  ///< sum of steps times depth, in odom [m^2]
};

}  // namespace geoflow::slam
