#pragma once

#include <cstddef>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {

/// A camera's pose at one moment, in single precision.
struct View {
  Eigen::Matrix3f R_world_cam = Eigen::Matrix3f::Identity();
  Eigen::Vector3f p_world_cam = Eigen::Vector3f::Zero();

  View() = default;
  explicit View(const SE3& T_world_cam)
      : R_world_cam{T_world_cam.rotation_matrix().cast<float>()},
        p_world_cam{T_world_cam.translation().cast<float>()} {}
};

/// Pixels to directions with z = 1, so that a ray's parameter is depth along the optical axis.
struct Pinhole {
  float inverse_fx = 1;
  float inverse_fy = 1;
  float cx = 0;
  float cy = 0;

  explicit Pinhole(const CameraIntrinsics& intrinsics)
      : inverse_fx{static_cast<float>(1.0 / intrinsics.fx)},
        inverse_fy{static_cast<float>(1.0 / intrinsics.fy)},
        cx{static_cast<float>(intrinsics.cx)},
        cy{static_cast<float>(intrinsics.cy)} {}

  [[nodiscard]] Eigen::Vector3f direction(float x, float y) const {
    return {(x - cx) * inverse_fx, (y - cy) * inverse_fy, 1.0F};
  }
};

/// A camera's way over some time: views at even steps of a millisecond or less, linear
/// between them. Of a turn that speeds up by 200 rad/s^2, as when a foot hits the ground, that is
/// within 2.5e-5 rad.
class ViewTrack {
 public:
  ViewTrack(double begin_s, double end_s, const PoseAt& T_world_cam);

  /// The view at a time, or at the nearer end.
  [[nodiscard]] View at(double t_s) const;

 private:
  double begin_s_;
  double step_s_;
  std::vector<View> views_;
};

/// Aims one lane of a packet.
inline void aim(RayPacket& packet, std::size_t lane, const Eigen::Vector3f& origin,
                const Eigen::Vector3f& direction) {
  packet.ray.org_x[lane] = origin.x();
  packet.ray.org_y[lane] = origin.y();
  packet.ray.org_z[lane] = origin.z();
  packet.ray.dir_x[lane] = direction.x();
  packet.ray.dir_y[lane] = direction.y();
  packet.ray.dir_z[lane] = direction.z();
}

/// One lane's direction, and where it ends.
inline Eigen::Vector3f direction_of(const RayPacket& packet, std::size_t lane) {
  return {packet.ray.dir_x[lane], packet.ray.dir_y[lane], packet.ray.dir_z[lane]};
}
inline Eigen::Vector3f end_of(const RayPacket& packet, std::size_t lane) {
  return Eigen::Vector3f{packet.ray.org_x[lane], packet.ray.org_y[lane], packet.ray.org_z[lane]} +
         packet.ray.tfar[lane] * direction_of(packet, lane);
}

}  // namespace geoflow::simulator
