#include "optimisation/pose_graph.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/map_correction.hpp"

namespace geoflow::slam {
namespace {

constexpr std::size_t kKeyframes = 80;

KeyframeId id_of(std::size_t i) {
  return KeyframeId{static_cast<std::uint32_t>(i)};
}

/// Where the camera truly was: a round of 20 m that ends where it began.
SE3 truth(std::size_t i) {
  constexpr double kRadiusM = 3.2;
  const double angle =
      2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(kKeyframes - 1);
  return SE3{so3::exp({0, 0, angle}), {kRadiusM * std::cos(angle), kRadiusM * std::sin(angle), 0}};
}

SE3 true_step(std::size_t from, std::size_t to) {
  const SE3 T_odom_from = truth(from);
  return T_odom_from.inverse() * truth(to);
}

KeyframeId add(Map& map, const SE3& T_odom_cam) {
  Keyframe keyframe;
  keyframe.T_odom_cam = T_odom_cam;
  return map.add_keyframe(std::move(keyframe));
}

/// A map whose every step is off by the same small motion, as systematic errors are: 0.25 m at the
/// end, and a point that each keyframe saw first, 2 m in front of it.
Map drifted_map() {
  Vector6d error;
  error << 0, 0, 0.0008, 0.001, -0.0005, 0.001;
  Map map;
  SE3 T_odom_cam = truth(0);
  for (std::size_t i = 0; i < kKeyframes; ++i) {
    if (i > 0) {
      T_odom_cam = T_odom_cam * true_step(i - 1, i) * SE3::exp(error);
    }
    const KeyframeId id = add(map, T_odom_cam);
    const PointId point = map.add_point(
        {.p_odom = T_odom_cam * Vector3d{0, 0, 2}, .descriptor = {}, .observations = {}});
    map.observe(point, {.keyframe = id, .pixel = Vector2d::Zero()});
  }
  return map;
}

RelativeEdge loop(std::size_t from, std::size_t to, const SE3& T_from_to) {
  constexpr double kSigma = 0.01;  // [rad], [m]
  return {.from = id_of(from),
          .to = id_of(to),
          .T_from_to = T_from_to,
          .information = Matrix6d::Identity() / (kSigma * kSigma),
          .kind = EdgeKind::kLoop};
}

double error_m(const Map& map, std::size_t i) {
  return (map.keyframe(id_of(i)).T_odom_cam.translation() - truth(i).translation()).norm();
}

TEST(PoseGraph, ClosesALoopAndSpreadsTheErrorOverTheWay) {
  Map map = drifted_map();
  const double before_end = error_m(map, kKeyframes - 1);
  const double before_half = error_m(map, kKeyframes / 2);
  ASSERT_GT(before_end, 0.1);
  const RelativeEdge closed = loop(0, kKeyframes - 1, true_step(0, kKeyframes - 1));
  EXPECT_TRUE(moves_map(map, closed));
  map.add_edge(closed);
  const PoseGraphSolution solution = solve_pose_graph(pose_graph(map));
  EXPECT_TRUE(solution.converged);
  EXPECT_TRUE(solution.contradicted.empty());
  const SE3 T_odom0_cam = map.keyframe(id_of(kKeyframes - 1)).T_odom_cam;
  const auto moved = correct(map, solution);
  ASSERT_TRUE(moved);
  // The loop's own deviation; and what a constant error leaves half way.
  EXPECT_LT(error_m(map, kKeyframes - 1), 0.01);
  EXPECT_LT(error_m(map, kKeyframes / 2), 0.7 * before_half);
  EXPECT_FALSE(moves_map(map, closed));
  EXPECT_LT(((*moved * T_odom0_cam).inverse() * map.keyframe(id_of(kKeyframes - 1)).T_odom_cam)
                .log()
                .norm(),
            1e-9);
  for (const auto& [id, point] : map.points()) {
    const SE3& T_odom_cam = map.keyframe(point.observations.front().keyframe).T_odom_cam;
    EXPECT_LT((T_odom_cam.inverse() * point.p_odom - Vector3d{0, 0, 2}).norm(), 1e-9);
  }
}

TEST(PoseGraph, FindsOutAWrongLoopAmongRightOnesAndLeavesTheMap) {
  Map map = drifted_map();
  for (std::size_t i = 0; i < 3; ++i) {
    map.add_edge(loop(i, kKeyframes - 1 - i, true_step(i, kKeyframes - 1 - i)));
  }
  Vector6d wrong;
  wrong << 0, 0, 0.5, 1, 0, 0;
  map.add_edge(loop(3, kKeyframes - 4, true_step(3, kKeyframes - 4) * SE3::exp(wrong)));
  const PoseGraphSolution solution = solve_pose_graph(pose_graph(map));
  ASSERT_EQ(solution.contradicted.size(), 1U);
  EXPECT_EQ(solution.contradicted[0], std::pair(id_of(3), id_of(kKeyframes - 4)));
  const SE3 T_odom_before = map.keyframe(id_of(kKeyframes - 1)).T_odom_cam;
  EXPECT_FALSE(correct(map, solution));
  const SE3& T_odom_after = map.keyframe(id_of(kKeyframes - 1)).T_odom_cam;
  EXPECT_EQ((T_odom_before.inverse() * T_odom_after).log().norm(), 0);
  EXPECT_EQ(map.edges().size(), 3U);
}

/// Registrations of depth between neighbours err alike each time (the pitch of a corridor's floor):
/// bundle adjustment weighs them against points and legs, of which the graph knows nothing.
TEST(PoseGraph, EdgesOfTheWayBendNothing) {
  Map map = drifted_map();
  Map with_edges = map;
  Vector6d tilt;
  tilt << 0, 0.004, 0, 0, 0, 0;
  for (std::size_t i = 0; i + 25 < kKeyframes; ++i) {
    RelativeEdge edge = loop(i, i + 25, true_step(i, i + 25) * SE3::exp(tilt));
    edge.kind = EdgeKind::kWay;
    with_edges.add_edge(edge);
  }
  const RelativeEdge closed = loop(0, kKeyframes - 1, true_step(0, kKeyframes - 1));
  map.add_edge(closed);
  with_edges.add_edge(closed);
  const auto without = solve_pose_graph(pose_graph(map)).T_odom_cam;
  const auto with = solve_pose_graph(pose_graph(with_edges)).T_odom_cam;
  for (const auto& [id, T_odom_cam] : without) {
    EXPECT_EQ((T_odom_cam.inverse() * with.at(id)).log().norm(), 0);
  }
}

TEST(PoseGraph, MovesKeyframesThatWereMadeWhileItWasSolved) {
  Map map = drifted_map();
  map.add_edge(loop(0, kKeyframes - 1, true_step(0, kKeyframes - 1)));
  const PoseGraphSolution solution = solve_pose_graph(pose_graph(map));
  const SE3& T_odom_newest = map.keyframe(id_of(kKeyframes - 1)).T_odom_cam;
  const SE3 T_newest_later{so3::exp({0, 0, 0.1}), {0.2, 0, 0}};
  const KeyframeId later = add(map, T_odom_newest * T_newest_later);
  ASSERT_TRUE(correct(map, solution));
  const SE3& T_odom_newest1 = map.keyframe(id_of(kKeyframes - 1)).T_odom_cam;
  const SE3& T_odom_later1 = map.keyframe(later).T_odom_cam;
  EXPECT_LT((T_newest_later.inverse() * (T_odom_newest1.inverse() * T_odom_later1)).log().norm(),
            1e-9);
}

}  // namespace
}  // namespace geoflow::slam
