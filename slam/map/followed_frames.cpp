#include "map/followed_frames.hpp"

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/trajectory.hpp"

#include "map/map.hpp"

namespace geoflow::slam {

Trajectory FollowedFrames::trajectory(const Map& map, const SE3& T_base_cam) const {
  Trajectory trajectory;
  const SE3 T_cam_base = T_base_cam.inverse();
  for (const FollowedFrame& frame : frames_) {
    const SE3 T_odom_reference =
        frame.reference ? map.keyframe(*frame.reference).T_odom_cam : SE3{};
    trajectory.push_back({frame.t, T_odom_reference * frame.T_reference_cam * T_cam_base});
  }
  return trajectory;
}

}  // namespace geoflow::slam
