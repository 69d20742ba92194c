#include "map/map_correction.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "optimisation/pose_graph.hpp"

namespace geoflow::slam {
namespace {

/// What odometry leaves of a step between keyframes: standard deviations, of the step and at least.
constexpr double kOfTheWay = 0.01;
constexpr double kLeastM = 0.005;
constexpr double kLeastRad = 0.003;

Matrix6d information_of_step(const SE3& T_from_to) {
  const Vector6d step = T_from_to.log();
  const double sigma_rad = kLeastRad + kOfTheWay * step.head<3>().norm();
  const double sigma_m = kLeastM + kOfTheWay * step.tail<3>().norm();
  Matrix6d information = Matrix6d::Zero();
  information.diagonal().head<3>().setConstant(1 / (sigma_rad * sigma_rad));
  information.diagonal().tail<3>().setConstant(1 / (sigma_m * sigma_m));
  return information;
}

}  // namespace

bool moves_map(const Map& map, const RelativeEdge& loop) {
  constexpr double kChi2Of6At95Percent = 12.59;
  const SE3& T_odom_from = map.keyframe(loop.from).T_odom_cam;
  const SE3& T_odom_to = map.keyframe(loop.to).T_odom_cam;
  const SE3& T_from_to = loop.T_from_to;
  const Vector6d error = (T_from_to.inverse() * (T_odom_from.inverse() * T_odom_to)).log();
  return error.dot(loop.information * error) > kChi2Of6At95Percent;
}

PoseGraphProblem pose_graph(const Map& map) {
  PoseGraphProblem problem;
  const auto inside = [&](KeyframeId id) { return map.keyframe(id).part == map.newest_part(); };
  for (auto it = map.keyframes().begin(); it != map.keyframes().end(); ++it) {
    if (!inside(it->first)) {
      continue;
    }
    problem.nodes.push_back({it->first, it->second.T_odom_cam});
    const auto next = std::next(it);
    if (next != map.keyframes().end() && !map.begins_thread(next->first)) {
      const SE3& T_odom_from = it->second.T_odom_cam;
      const SE3& T_odom_to = next->second.T_odom_cam;
      const SE3 T_from_to = T_odom_from.inverse() * T_odom_to;
      problem.way.push_back({it->first, next->first, T_from_to, information_of_step(T_from_to)});
    }
  }
  std::ranges::copy_if(map.joins(), std::back_inserter(problem.way),
                       [&](const RelativeEdge& join) { return inside(join.to); });
  for (const RelativeEdge& edge : map.edges()) {
    if (inside(edge.to) && edge.kind == EdgeKind::kLoop) {
      problem.loops.push_back(edge);
    }
  }
  return problem;
}

std::optional<SE3> correct(Map& map, const PoseGraphSolution& solution) {
  for (const auto& [from, to] : solution.contradicted) {
    map.remove_edges(from, to);
  }
  if (!solution.converged || !solution.contradicted.empty() || solution.T_odom_cam.empty()) {
    return std::nullopt;
  }
  // T_odom1_odom0 of each keyframe.
  const auto& [newest, pose] = *solution.T_odom_cam.rbegin();
  SE3 newest_motion = pose * map.keyframe(newest).T_odom_cam.inverse();
  std::map<KeyframeId, SE3> motion;
  for (const auto& [id, keyframe] : map.keyframes()) {
    const auto solved = solution.T_odom_cam.find(id);
    if (solved != solution.T_odom_cam.end()) {
      motion.emplace(id, solved->second * keyframe.T_odom_cam.inverse());
    } else {
      motion.emplace(id, id > newest ? newest_motion : SE3{});  // or it is of another part
    }
  }
  map.move([&](KeyframeId id) { return motion.at(id); });
  return newest_motion;
}

}  // namespace geoflow::slam
