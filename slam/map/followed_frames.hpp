#pragma once

#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

#include "map/ids.hpp"

namespace geoflow::slam {

class Map;

/// Every frame's pose relative to a keyframe, so that it follows when the keyframe is moved by
/// later optimisation; without a reference, of a frame before there was any, in odom.
class FollowedFrames {
 public:
  [[nodiscard]] bool empty() const noexcept { return frames_.empty(); }
  void add(HostTime t, std::optional<KeyframeId> reference, const SE3& T_reference_cam) {
    frames_.push_back({t, reference, T_reference_cam});
  }
  /// The newest frame has become this keyframe.
  void newest_is(KeyframeId id) {
    frames_.back().reference = id;
    frames_.back().T_reference_cam = SE3{};
  }
  /// T_odom_base of all, in order of time, where the map has their keyframes now.
  [[nodiscard]] Trajectory trajectory(const Map& map, const SE3& T_base_cam) const;

 private:
  struct FollowedFrame {
    HostTime t;
    std::optional<KeyframeId> reference;
    SE3 T_reference_cam;
  };
  std::vector<FollowedFrame> frames_;
};

}  // namespace geoflow::slam
