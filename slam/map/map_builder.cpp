#include "map/map_builder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <ranges>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/gicp.hpp"
#include "map/ids.hpp"
#include "map/local_map.hpp"
#include "map/map.hpp"
#include "map/mapping_problem.hpp"
#include "map/overlap.hpp"
#include "map/point_search.hpp"
#include "odometry/frame.hpp"
#include "optimisation/matrix6.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam {
namespace {

constexpr double kEdgeOverlap =
    0.4;  ///< keyframes that share at least this much of their depth are registered
constexpr std::size_t kCloudsKept = 300;   ///< keyframes whose depth stays in memory
constexpr std::size_t kPyramidsKept = 30;  ///< keyframes whose image does, at 2 MB each

/// The point nearest to two rays; none where they are nearly parallel or meet behind a camera.
std::optional<Vector3d> intersect(const Vector3d& origin_a, const Vector3d& ray_a,
                                  const Vector3d& origin_b, const Vector3d& ray_b) {
  constexpr double kLeastParallax = 0.02;  // [rad]
  const double sine = ray_a.cross(ray_b).norm() / (ray_a.norm() * ray_b.norm());
  if (sine < kLeastParallax) {
    return std::nullopt;
  }
  Eigen::Matrix<double, 3, 2> A;
  A << ray_a, -ray_b;
  const Vector2d depth = (A.transpose() * A).ldlt().solve(A.transpose() * (origin_b - origin_a));
  if (depth.minCoeff() <= 0) {
    return std::nullopt;
  }
  return 0.5 * (origin_a + depth.x() * ray_a + origin_b + depth.y() * ray_b);
}

/// Copies these keyframes, the points that at least two of them observe, and the edges between them
/// into a problem. At least one keyframe is held, the oldest if no other.
void copy_into(MappingProblem& problem, const Map& map, const std::set<KeyframeId>& moving,
               const std::set<KeyframeId>& held, const std::set<PointId>& points) {
  const auto inside = [&](KeyframeId id) { return moving.contains(id) || held.contains(id); };
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (inside(id)) {
      problem.keyframes.push_back(
          {id, keyframe.T_odom_cam, held.contains(id), keyframe.cloud, keyframe.gyro, keyframe.up});
    }
  }
  if (held.empty()) {
    problem.keyframes.front().fixed = true;
  }
  for (const PointId id : points) {
    const MapPoint& point = *map.find_point(id);
    MappingPoint snapshot{.id = id, .p_odom = point.p_odom, .observations = {}};
    std::ranges::copy_if(point.observations, std::back_inserter(snapshot.observations),
                         [&](const Observation& o) { return inside(o.keyframe); });
    if (snapshot.observations.size() > 1) {
      problem.points.push_back(std::move(snapshot));
    }
  }
  for (const auto* edges : {&map.edges(), &map.joins()}) {
    std::ranges::copy_if(*edges, std::back_inserter(problem.edges),
                         [&](const RelativeEdge& e) { return inside(e.from) && inside(e.to); });
  }
}

/// Which way is up in odom: as the oldest keyframe of a part has felt it.
std::optional<UpDirection> up_in(const Map& map, PartId part) {
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (keyframe.part == part && keyframe.up) {
      return keyframe.up->seen_from(keyframe.T_odom_cam.rotation_matrix());
    }
  }
  return std::nullopt;
}

/// All that legs and IMU say of the motion from one keyframe to a later one.
std::optional<RelativeEdge> reckoned_between(const Map& map, KeyframeId from, KeyframeId to) {
  KeyframeId reached = to;
  SE3 T_reached_to;
  Matrix6d covariance = Matrix6d::Zero();
  while (reached != from) {
    const std::optional<RelativeEdge>& step = map.keyframe(reached).reckoned;
    if (!step || step->from < from) {
      return std::nullopt;
    }
    const Matrix6d A = T_reached_to.inverse().adjoint();
    covariance += A * inverse(step->information) * A.transpose();
    const SE3& T_before_reached = step->T_from_to;
    T_reached_to = T_before_reached * T_reached_to;  // frames: reached is now the one before
    reached = step->from;
  }
  return RelativeEdge{
      .from = from, .to = to, .T_from_to = T_reached_to, .information = inverse(covariance)};
}

}  // namespace

MapBuilder::MapBuilder(const Config& config, const GicpConfig& gicp, const Calibration& calibration,
                       StageObserver* observer)
    : config_{config},
      gicp_{gicp},
      camera_{calibration.camera},
      gyro_random_walk_{calibration.imu_noise.gyro_random_walk},
      orb_{config.features},
      observer_{observer} {}

KeyframeId MapBuilder::insert(Map& map, Frame& frame, const Matrix6d& covariance) {
  cull(map, frame);
  if (!frame.place) {
    const StageScope scope{observer_, Stage::kFeatures};
    frame.place =
        describe_place(frame.pyramid->image(), frame.depth, frame.cloud.get(), camera_, orb_);
  }
  const KeyframeId id = map.add_keyframe({.t = frame.t,
                                          .T_odom_cam = frame.T_odom_cam,
                                          .covariance = covariance,
                                          .cloud = frame.cloud,
                                          .place = frame.place,
                                          .pyramid = frame.pyramid,
                                          .rows = frame.rows,
                                          .points = {}});
  observe_features(map, id, frame);
  add_features(map, id, frame);
  map.keep_newest(kCloudsKept, kPyramidsKept);
  return id;
}

void MapBuilder::cull(Map& map, const Frame& frame) const {
  constexpr std::uint32_t kEnoughChances = 8;
  constexpr double kLeastFound = 0.5;
  for (const Feature& feature : frame.features) {
    if (!feature.point) {
      continue;
    }
    const MapPoint* point = map.find_point(*feature.point);
    if (point != nullptr && point->expected >= kEnoughChances &&
        point->found < kLeastFound * point->expected) {
      map.remove_point(*feature.point);
    }
  }
}

void MapBuilder::observe_features(Map& map, KeyframeId keyframe, Frame& frame) const {
  for (Feature& feature : frame.features) {
    if (feature.point && map.find_point(*feature.point) == nullptr) {
      feature.point.reset();
    }
    if (feature.point) {
      map.observe(*feature.point,
                  {.keyframe = keyframe, .pixel = feature.ideal, .depth_m = feature.depth_m});
    } else {
      triangulate(map, keyframe, feature);
    }
  }
}

void MapBuilder::triangulate(Map& map, KeyframeId keyframe, Feature& feature) const {
  const SE3& T_odom_cam = map.keyframe(keyframe).T_odom_cam;
  std::optional<Vector3d> p_odom;
  if (feature.depth_m > 0) {
    p_odom = T_odom_cam * camera_.unproject(feature.ideal, feature.depth_m);
  } else if (feature.anchor) {
    const SE3& T_odom_anchor = map.keyframe(feature.anchor->keyframe).T_odom_cam;
    p_odom = intersect(T_odom_anchor.translation(),
                       T_odom_anchor.rotation() * camera_.unproject(feature.anchor->pixel, 1),
                       T_odom_cam.translation(),
                       T_odom_cam.rotation() * camera_.unproject(feature.ideal, 1));
  }
  if (!p_odom) {
    if (!feature.anchor) {
      feature.anchor = Feature::Anchor{.keyframe = keyframe, .pixel = feature.ideal};
    }
    return;
  }
  feature.point =
      map.add_point({.p_odom = *p_odom, .descriptor = feature.descriptor, .observations = {}});
  if (feature.anchor) {
    map.observe(
        *feature.point,
        {.keyframe = feature.anchor->keyframe, .pixel = feature.anchor->pixel, .depth_m = 0});
  }
  map.observe(*feature.point,
              {.keyframe = keyframe, .pixel = feature.ideal, .depth_m = feature.depth_m});
}

void MapBuilder::add_features(Map& map, KeyframeId keyframe, Frame& frame) {
  constexpr double kSearchRadiusPx = 8;
  const StageScope scope{observer_, Stage::kFeatures};
  std::vector<Vector2d> taken;
  taken.reserve(frame.features.size());
  for (const Feature& feature : frame.features) {
    taken.push_back(feature.raw);
  }
  std::vector<Feature> added;
  const cv::Size image = frame.pyramid->image().size();
  for (const OrbFeature& feature :
       choose_new(frame.place->features, taken, image, config_.features)) {
    added.push_back(frame.feature_at(feature.pixel, camera_));
    added.back().descriptor = feature.descriptor;
  }
  const auto points = find_points(map, frame, added, kSearchRadiusPx, camera_);
  for (std::size_t j = 0; j < added.size(); ++j) {
    added[j].point = points[j];
    if (const std::optional<PointId>& point = points[j]) {
      map.observe(*point,
                  {.keyframe = keyframe, .pixel = added[j].ideal, .depth_m = added[j].depth_m});
    } else {
      triangulate(map, keyframe, added[j]);
    }
    frame.features.push_back(added[j]);
  }
}

std::vector<EdgeToMeasure> MapBuilder::edges_to_measure(const Map& map, KeyframeId newest) const {
  const Keyframe& center = map.keyframe(newest);
  if (!center.cloud) {
    return {};
  }
  auto overlapping = overlapping_keyframes(map, *center.cloud, center.T_odom_cam, kEdgeOverlap);
  const auto wanted = [&](KeyframeId id) {
    const bool consecutive = std::next(map.keyframes().find(id)) == map.keyframes().find(newest);
    return config_.switches.depth_to_map || (config_.switches.gicp && consecutive);
  };
  const LocalMap local{map, newest};
  std::erase_if(overlapping, [&](const OverlappingKeyframe& k) {
    return k.id == newest || !local.contains(k.id) || !wanted(k.id);
  });
  std::vector<EdgeToMeasure> edges;
  for (const KeyframeId id : registration_targets(
           overlapping, static_cast<std::size_t>(config_.mapping.map_neighbours))) {
    edges.push_back({.from = id, .to = newest, .reckoned = reckoned_between(map, id, newest)});
  }
  return edges;
}

std::set<KeyframeId> MapBuilder::held_keyframes(const Map& map, const std::set<KeyframeId>& moving,
                                                const std::set<PointId>& points,
                                                const MappingProblem& problem) const {
  constexpr std::size_t kEdgeCounts = 100;  // an edge ties as firmly as this many common points
  std::map<KeyframeId, std::size_t> connection;
  const auto connect = [&](KeyframeId a, KeyframeId b) {
    if (moving.contains(a) != moving.contains(b)) {
      connection[moving.contains(a) ? b : a] += kEdgeCounts;
    }
  };
  for (const PointId id : points) {
    for (const Observation& observation : map.find_point(id)->observations) {
      if (!moving.contains(observation.keyframe)) {
        ++connection[observation.keyframe];
      }
    }
  }
  for (const RelativeEdge& edge : map.edges()) {
    connect(edge.from, edge.to);
  }
  for (const EdgeToMeasure& pair : problem.edges_to_measure) {
    connect(pair.from, pair.to);
  }
  std::vector<std::pair<std::size_t, KeyframeId>> by_connection;
  by_connection.reserve(connection.size());
  for (const auto& [id, strength] : connection) {
    by_connection.emplace_back(strength, id);
  }
  std::ranges::sort(std::ranges::reverse_view(by_connection));
  by_connection.resize(
      std::min(by_connection.size(), static_cast<std::size_t>(config_.mapping.fixed)));
  std::set<KeyframeId> held;
  for (const auto& [strength, id] : by_connection) {
    held.insert(id);
  }
  // Registrations and points leave directions open: what legs and IMU say of the way to the window
  // does not.
  const std::optional<RelativeEdge>& way_here = map.keyframe(*moving.begin()).reckoned;
  if (way_here && map.same_part(way_here->from, *moving.begin())) {
    held.insert(way_here->from);
  }
  return held;
}

std::shared_ptr<MappingProblem> MapBuilder::empty_problem() const {
  auto problem = std::make_shared<MappingProblem>();
  problem->camera = camera_.intrinsics();
  problem->pose = config_.pose;
  problem->mapping = config_.mapping;
  problem->gicp = gicp_;
  problem->gyro_random_walk = gyro_random_walk_;
  return problem;
}

MappingTask MapBuilder::task(const Map& map, KeyframeId newest) const {
  auto problem = empty_problem();
  problem->edges_to_measure = edges_to_measure(map, newest);

  std::set<KeyframeId> moving;
  std::set<PointId> points;
  for (auto it = map.keyframes().rbegin();
       it != map.keyframes().rend() &&
       moving.size() < static_cast<std::size_t>(config_.mapping.window);
       ++it) {
    if (!map.same_part(it->first, newest)) {
      continue;
    }
    moving.insert(it->first);
    points.insert(it->second.points.begin(), it->second.points.end());
  }
  const std::set<KeyframeId> held = held_keyframes(map, moving, points, *problem);
  problem->up_odom = up_in(map, map.keyframe(newest).part);
  copy_into(*problem, map, moving, held, points);
  std::erase_if(problem->edges_to_measure, [&](const auto& pair) {
    return !moving.contains(pair.from) && !held.contains(pair.from);
  });
  return {.problem = problem};
}

MappingTask MapBuilder::whole_map_task(const Map& map) const {
  auto problem = empty_problem();
  problem->whole_map = true;
  std::set<KeyframeId> moving;
  std::set<PointId> points;
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (keyframe.part == map.newest_part()) {
      moving.insert(id);
      points.insert(keyframe.points.begin(), keyframe.points.end());
    }
  }
  problem->up_odom = up_in(map, map.newest_part());
  copy_into(*problem, map, moving, {}, points);
  return {.problem = problem};
}

SE3 MapBuilder::apply(Map& map, const MappingSolution& solution) const {
  SE3 T_odom1_odom0;
  if (!solution.T_odom_cam.empty()) {
    const auto& [newest, pose] = *solution.T_odom_cam.rbegin();
    T_odom1_odom0 = pose * map.keyframe(newest).T_odom_cam.inverse();
    for (auto it = map.keyframes().upper_bound(newest); it != map.keyframes().end(); ++it) {
      map.keyframe(it->first).T_odom_cam = T_odom1_odom0 * it->second.T_odom_cam;
    }
  }
  for (const auto& [id, pose] : solution.T_odom_cam) {
    map.keyframe(id).T_odom_cam = pose;
  }
  for (const auto& [id, bias] : solution.gyro_bias) {
    map.keyframe(id).gyro.bias = bias;
  }
  for (const auto& [id, p_odom] : solution.p_odom) {
    if (MapPoint* point = map.find_point(id)) {
      point->p_odom = p_odom;
    }
  }
  for (const auto& [point, keyframe] : solution.outliers) {
    map.remove_observation(point, keyframe);
  }
  for (const RelativeEdge& edge : solution.measured) {
    map.add_edge(edge);
  }
  return T_odom1_odom0;
}

}  // namespace geoflow::slam
