#include "odometry/patch_refiner.hpp"

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/pixel_depth.hpp"
#include "map/map.hpp"
#include "vision/camera_model.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/patch_alignment.hpp"
#include "vision/row_time.hpp"

namespace geoflow::slam {
namespace {

/// A view of a patch that is farther away or more slanted than this does not show what the frame
/// shows.
constexpr double kLeastScale = 0.6;
constexpr double kLargestScale = 3;
constexpr double kLargestAnisotropy = 3;

}  // namespace

std::optional<PatchWarp> PatchRefiner::warp(const Keyframe& reference, const Vector3d& p_odom,
                                            const Vector2d& ideal, const SE3& T_odom_cam,
                                            const Vector2d& raw) const {
  const Vector2d at_middle = camera_.distort(ideal);
  const SE3& T_odom_reference = reference.T_odom_cam;
  const Vector3d p_reference = T_odom_reference.inverse() * p_odom;
  const Surfel* surfel = surface_at(*reference.cloud, at_middle, p_reference);
  if (surfel == nullptr) {
    return std::nullopt;
  }
  const RowMotion& rows = reference.rows;
  const Vector2d in_reference =
      camera_.distort(ideal - rows.readout_s * row_shift(camera_, rows.twist, ideal, at_middle.y(),
                                                         p_reference.z()));
  const SE3 T_reference_cam = T_odom_reference.inverse() * T_odom_cam;
  const Vector3d normal = surfel->normal.cast<double>();
  const Vector3d& origin = T_reference_cam.translation();
  const double distance = normal.dot(surfel->point.cast<double>() - origin);
  const auto seen_at = [&](const Vector2d& pixel) -> std::optional<Vector2d> {
    const Vector3d ray =
        T_reference_cam.rotation() * camera_.unproject(camera_.undistort(pixel), 1);
    const double range = distance / normal.dot(ray);
    const Vector3d met = origin + range * ray;
    if (!(range > 0) || !(met.z() > 0)) {
      return std::nullopt;
    }
    return camera_.distort(camera_.project(met));
  };
  const auto middle = seen_at(raw);
  constexpr double kRadius = kPatchRadiusPx;
  const std::array<Vector2d, 4> offsets = {Vector2d{-kRadius, -kRadius},
                                           Vector2d{kRadius, -kRadius}, Vector2d{kRadius, kRadius},
                                           Vector2d{-kRadius, kRadius}};
  Eigen::Matrix<double, 2, 4> corners;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const auto corner = seen_at(raw + offsets.at(i));
    if (!middle || !corner) {
      return std::nullopt;
    }
    // The shape is the geometry's, the place is the keyframe's own.
    corners.col(static_cast<Eigen::Index>(i)) = in_reference + (*corner - *middle);
  }
  return make_warp(corners);
}

PatchSearch PatchRefiner::refine(const Map& map, const MapPoint& point, const SE3& T_odom_cam,
                                 const ImagePyramid& current, const Vector2d& raw) const {
  for (const Observation& observation : point.observations) {
    const Keyframe& reference = map.keyframe(observation.keyframe);
    if (!reference.pyramid || !reference.cloud) {
      continue;
    }
    const auto found = warp(reference, point.p_odom, observation.pixel, T_odom_cam, raw);
    if (found && found->scale > kLeastScale && found->scale < kLargestScale &&
        found->anisotropy < kLargestAnisotropy) {
      return align_patch(*reference.pyramid, *found, current, raw);
    }
  }
  return {};
}

}  // namespace geoflow::slam
