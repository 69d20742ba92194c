#pragma once

#include <map>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/map.hpp"

namespace geoflow::slam {

struct PoseGraphNode {
  KeyframeId id{};
  SE3 T_odom_cam;
};

/// Keyframes and what is known of their relative poses.
struct PoseGraphProblem {
  std::vector<PoseGraphNode> nodes;  ///< in order of id; the first is held
  std::vector<RelativeEdge> way;     ///< between consecutive ones
  std::vector<RelativeEdge> loops;   ///< between others; may be wrong
};

struct PoseGraphSolution {
  std::map<KeyframeId, SE3> T_odom_cam;
  /// Loops that the solution contradicts, by their keyframes.
  std::vector<std::pair<KeyframeId, KeyframeId>> contradicted;
  bool converged = false;
};

/// The most likely poses: RelativePoseFactor for each edge, those of loops with Cauchy's robust
/// loss; a loop is contradicted when its chi-square at the solution is beyond the 99.9 % point of
/// six degrees of freedom. Pure, deterministic, thread-safe.
[[nodiscard]] PoseGraphSolution solve_pose_graph(const PoseGraphProblem& problem);

}  // namespace geoflow::slam
