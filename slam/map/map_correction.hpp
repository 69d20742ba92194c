#pragma once

#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/map.hpp"
#include "optimisation/pose_graph.hpp"

namespace geoflow::slam {

/// Whether a loop moves its new keyframe by more than the loop's own uncertainty (chi-square at
/// 95 %), so that closing it is worth while.
[[nodiscard]] bool moves_map(const Map& map, const RelativeEdge& loop);

/// All keyframes of the newest part; between consecutive ones their present relative pose, as
/// uncertain as odometry leaves it; what joined earlier parts to it; and the loops. Not the way's
/// other edges: bundle adjustment has weighed them already, against points that the graph does not
/// know.
[[nodiscard]] PoseGraphProblem pose_graph(const Map& map);

/// Takes over a pose graph's solution: keyframes get their new poses, those made since move along
/// with the newest one, and points with the keyframe that saw them first. Returns that newest
/// keyframe's motion, T_odom1_odom0, to be applied on the left to whatever depends on it. Loops
/// that the solution contradicts are forgotten and nothing else is changed; nothing is returned
/// then, nor where the solution did not converge.
[[nodiscard]] std::optional<SE3> correct(Map& map, const PoseGraphSolution& solution);

}  // namespace geoflow::slam
