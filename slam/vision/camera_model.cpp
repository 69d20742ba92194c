#include "vision/camera_model.hpp"

#include <cmath>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {
namespace {

/// Brown-Conrady as in OpenCV: k1 k2 p1 p2 k3.
Vector2d distort_radtan(const CameraIntrinsics& k, const Vector2d& n) noexcept {
  const double r2 = n.squaredNorm();
  const double radial = 1 + r2 * (k.distortion[0] + r2 * (k.distortion[1] + r2 * k.distortion[4]));
  const double p1 = k.distortion[2];
  const double p2 = k.distortion[3];
  return {n.x() * radial + 2 * p1 * n.x() * n.y() + p2 * (r2 + 2 * n.x() * n.x()),
          n.y() * radial + p1 * (r2 + 2 * n.y() * n.y()) + 2 * p2 * n.x() * n.y()};
}

/// Kannala-Brandt: k1 k2 k3 k4.
Vector2d distort_equidistant(const CameraIntrinsics& k, const Vector2d& n) noexcept {
  constexpr double kTiny = 1e-9;
  const double r = n.norm();
  if (r < kTiny) {
    return n;
  }
  const double theta = std::atan(r);
  const double t2 = theta * theta;
  const double theta_d =
      theta * (1 + t2 * (k.distortion[0] +
                         t2 * (k.distortion[1] + t2 * (k.distortion[2] + t2 * k.distortion[3]))));
  return n * (theta_d / r);
}

Vector2d distort_normalised(const CameraIntrinsics& k, const Vector2d& n) noexcept {
  switch (k.model) {
    case DistortionModel::kRadtan:
      return distort_radtan(k, n);
    case DistortionModel::kEquidistant:
      return distort_equidistant(k, n);
    case DistortionModel::kNone:
      break;
  }
  return n;
}

}  // namespace

Eigen::Matrix<double, 2, 3> CameraModel::project_jacobian(const Vector3d& p_cam) const noexcept {
  const double inverse_z = 1 / p_cam.z();
  Eigen::Matrix<double, 2, 3> J;
  J << k_.fx * inverse_z, 0, -k_.fx * p_cam.x() * inverse_z * inverse_z, 0, k_.fy * inverse_z,
      -k_.fy * p_cam.y() * inverse_z * inverse_z;
  return J;
}

Vector2d CameraModel::distort(const Vector2d& ideal) const noexcept {
  if (k_.model == DistortionModel::kNone) {
    return ideal;
  }
  const Vector2d n =
      distort_normalised(k_, {(ideal.x() - k_.cx) / k_.fx, (ideal.y() - k_.cy) / k_.fy});
  return {n.x() * k_.fx + k_.cx, n.y() * k_.fy + k_.cy};
}

Vector2d CameraModel::undistort(const Vector2d& raw) const noexcept {
  if (k_.model == DistortionModel::kNone) {
    return raw;
  }
  constexpr int kIterations = 20;
  const Vector2d target{(raw.x() - k_.cx) / k_.fx, (raw.y() - k_.cy) / k_.fy};
  Vector2d n = target;
  for (int i = 0; i < kIterations; ++i) {
    n += target - distort_normalised(k_, n);
  }
  return {n.x() * k_.fx + k_.cx, n.y() * k_.fy + k_.cy};
}

}  // namespace geoflow::slam
