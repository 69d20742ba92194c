#include "map/map.hpp"

#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"

namespace geoflow::slam {

KeyframeId Map::add_keyframe(Keyframe keyframe) {
  const KeyframeId id{next_keyframe_++};
  if (keyframe.place) {
    places_.add(id, *keyframe.place);
  }
  keyframes_.emplace(id, std::move(keyframe));
  return id;
}

void Map::describe(KeyframeId id, std::shared_ptr<const PlaceView> place) {
  Keyframe& described = keyframes_.at(id);
  if (!described.place && place) {
    places_.add(id, *place);
    described.place = std::move(place);
  }
}

void Map::remove_edges(KeyframeId from, KeyframeId to) {
  std::erase_if(edges_, [&](const RelativeEdge& e) { return e.from == from && e.to == to; });
}

PointId Map::add_point(MapPoint point) {
  const PointId id{next_point_++};
  points_.emplace(id, std::move(point));
  return id;
}

void Map::observe(PointId id, const Observation& observation) {
  points_.at(id).observations.push_back(observation);
  keyframes_.at(observation.keyframe).points.push_back(id);
}

void Map::remove_point(PointId id) {
  const auto point = points_.find(id);
  if (point == points_.end()) {
    return;
  }
  for (const Observation& observation : point->second.observations) {
    std::erase(keyframes_.at(observation.keyframe).points, id);
  }
  points_.erase(point);
}

void Map::remove_observation(PointId id, KeyframeId keyframe) {
  MapPoint* point = find_point(id);
  if (point == nullptr) {
    return;
  }
  std::erase_if(point->observations, [&](const Observation& o) { return o.keyframe == keyframe; });
  std::erase(keyframes_.at(keyframe).points, id);
  if (point->observations.empty()) {
    points_.erase(id);
  }
}

void Map::move(const std::function<SE3(KeyframeId)>& T_odom1_odom0) {
  for (auto& [id, point] : points_) {
    point.p_odom = T_odom1_odom0(point.observations.front().keyframe) * point.p_odom;
  }
  for (auto& [id, keyframe] : keyframes_) {
    keyframe.T_odom_cam = T_odom1_odom0(id) * keyframe.T_odom_cam;
  }
}

void Map::keep_newest(std::size_t clouds, std::size_t pyramids) {
  std::size_t age = 0;
  for (auto it = keyframes_.rbegin(); it != keyframes_.rend(); ++it, ++age) {
    if (age >= clouds) {
      it->second.cloud.reset();
    }
    if (age >= pyramids) {
      it->second.pyramid.reset();
    }
  }
}

MapPoint* Map::find_point(PointId id) {
  const auto point = points_.find(id);
  return point == points_.end() ? nullptr : &point->second;
}

const MapPoint* Map::find_point(PointId id) const {
  const auto point = points_.find(id);
  return point == points_.end() ? nullptr : &point->second;
}

}  // namespace geoflow::slam
