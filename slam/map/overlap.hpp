#pragma once

#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "map/map.hpp"

namespace geoflow::slam {

/// How the depth of two views goes together, as shares of the first one's surfels.
struct DepthAgreement {
  double seen = 0;      ///< that fall on a surfel of the second view
  double agreeing = 0;  ///< of all, those that lie on its surface
};

/// Of about 100 surfels spread over `source`, at a given pose in the view of `target`.
[[nodiscard]] DepthAgreement depth_agreement(const DepthCloud& source, const DepthCloud& target,
                                             const SE3& T_target_source);

struct OverlappingKeyframe {
  KeyframeId id;
  double overlap;  ///< share of the frame's depth that the keyframe sees at the same place, 0 to 1
};

/// Keyframes of the newest part that see at least `least_overlap` of what `cloud` sees from
/// `T_odom_cam`, most overlap first.
[[nodiscard]] std::vector<OverlappingKeyframe> overlapping_keyframes(const Map& map,
                                                                     const DepthCloud& cloud,
                                                                     const SE3& T_odom_cam,
                                                                     double least_overlap);

/// At most `count` of them to register a frame to: the one with most overlap, then the oldest ones.
/// What was mapped first has drifted least, and a frame that still sees it need not drift further.
[[nodiscard]] std::vector<KeyframeId> registration_targets(
    const std::vector<OverlappingKeyframe>& overlapping, std::size_t count);

}  // namespace geoflow::slam
