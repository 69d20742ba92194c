#include "vision/row_time.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "vision/camera_model.hpp"

namespace geoflow::slam {
namespace {

/// Before anything is seen: a readout within an image's interval, most often less.
constexpr double kPriorSigma_s = 0.01;
constexpr double kLongest_s = 0.033;
/// Features of an image err together, and from image to image: so many count as one.
constexpr double kErrTogether = 4;
constexpr std::size_t kFewest = 12;

}  // namespace

Vector2d row_shift(const CameraModel& camera, const Vector6d& twist, const Vector2d& ideal,
                   double row, double depth_m) {
  const bool known = depth_m > 0;
  const Vector3d p_cam = camera.unproject(ideal, known ? depth_m : 1);
  Vector3d moves = twist.head<3>().cross(p_cam);
  if (known) {
    moves += twist.tail<3>();
  }
  const double later = (row + 0.5) / camera.intrinsics().height - 0.5;
  return later * (camera.project_jacobian(p_cam) * moves);
}

void ReadoutEstimate::add(std::span<const Feature> features, double sigma_px) {
  if (features.size() < kFewest) {
    return;
  }
  Matrix6d H = Matrix6d::Zero();
  Vector6d h = Vector6d::Zero();
  Vector6d g = Vector6d::Zero();
  double a = 0;
  double b = 0;
  for (const Feature& feature : features) {
    H += feature.by_pose.transpose() * feature.by_pose;
    h += feature.by_pose.transpose() * feature.shift;
    g += feature.by_pose.transpose() * feature.residual;
    a += feature.shift.squaredNorm();
    b += feature.shift.dot(feature.residual);
  }
  const Vector6d explained = H.ldlt().solve(h);
  const double weight = 1 / (kErrTogether * sigma_px * sigma_px);
  const double information = weight * (a - h.dot(explained));
  const double too_little = weight * (b - g.dot(explained));
  if (!std::isfinite(information) || !std::isfinite(too_little) || information <= 0) {
    return;
  }
  information_ += information;
  weighted_ += information * seconds_ + too_little;
  const double prior = 1 / (kPriorSigma_s * kPriorSigma_s);
  seconds_ = std::clamp(weighted_ / (information_ + prior), -kLongest_s, kLongest_s);
}

double ReadoutEstimate::sigma() const noexcept {
  return 1 / std::sqrt(information_ + 1 / (kPriorSigma_s * kPriorSigma_s));
}

}  // namespace geoflow::slam
