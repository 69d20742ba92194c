#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "map/map.hpp"
#include "vision/place_view.hpp"

/// What goes into and comes out of the search for loops of one keyframe: plain snapshots, so that
/// it can run in any thread.
namespace geoflow::slam {

/// What a keyframe saw.
struct LoopView {
  KeyframeId id{};
  std::shared_ptr<const PlaceView> place;
  std::shared_ptr<const DepthCloud> cloud;  ///< null: none, or let go
  /// Where odometry has the new one, seen from it; none where they are of different parts.
  std::optional<SE3> T_this_new{};
};

/// A keyframe and old ones that look like it or should see the same.
struct LoopProblem {
  LoopView newest;
  std::vector<LoopView> candidates;
  CameraIntrinsics camera;
  Config config;
  GicpConfig gicp;
};

/// Two views of one place, so far as they themselves can tell.
struct LoopHypothesis {
  RelativeEdge edge;     ///< from the old keyframe to the new one
  bool certain = false;  ///< needs no others that say the same
};

struct LoopSolution {
  std::vector<LoopHypothesis> found;
};

}  // namespace geoflow::slam
