#include "map/map.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/log.hpp"

#include "map/ids.hpp"

namespace geoflow::slam {

namespace {

/// Ids between parts: keyframes of two are not neighbours in time.
constexpr std::uint32_t kPartsApart = 1000;

template <typename Id, typename T>
std::uint32_t id_after(const std::map<Id, T>& things) {
  return things.empty() ? 0 : static_cast<std::uint32_t>(things.rbegin()->first) + 1;
}

}  // namespace

Map::Map(MapContents contents)
    : contents_{std::move(contents)},
      next_keyframe_{id_after(contents_.keyframes)},
      next_point_{id_after(contents_.points)} {
  for (const auto& [id, keyframe] : contents_.keyframes) {
    newest_part_ = std::max(newest_part_, keyframe.part);
    if (keyframe.place) {
      places_.add(id, *keyframe.place);
    }
  }
  next_part_ = static_cast<std::uint32_t>(newest_part_) + 1;
  begin_part();
}

void Map::begin_part() {
  if (!contents_.keyframes.empty()) {
    next_keyframe_ = id_after(contents_.keyframes) + kPartsApart;
    newest_part_ = PartId{next_part_++};
  }
}

bool Map::is_tied() const {
  const bool joined = newest_part_ != PartId{next_part_ - 1};  // to the part whose id it has
  return joined || contents_.keyframes.empty() ||
         contents_.keyframes.begin()->second.part == newest_part_;
}

SE3 Map::join(const RelativeEdge& tie) {
  const PartId kept = keyframe(tie.from).part;
  const PartId given_up = keyframe(tie.to).part;
  const SE3& T_odom1_from = keyframe(tie.from).T_odom_cam;
  const SE3& T_from_to = tie.T_from_to;
  const SE3 T_to_odom0 = keyframe(tie.to).T_odom_cam.inverse();
  const SE3 T_odom1_odom0 = T_odom1_from * T_from_to * T_to_odom0;
  move([&](KeyframeId id) { return keyframe(id).part == given_up ? T_odom1_odom0 : SE3{}; });
  for (auto& [id, moved] : contents_.keyframes) {
    if (moved.part == given_up) {
      moved.part = kept;
    }
  }
  if (newest_part_ == given_up) {
    newest_part_ = kept;
  }
  contents_.joins.push_back(tie);
  return T_odom1_odom0;
}

KeyframeId Map::add_keyframe(Keyframe keyframe) {
  const KeyframeId id{next_keyframe_++};
  keyframe.part = newest_part_;
  if (keyframe.place) {
    places_.add(id, *keyframe.place);
  }
  contents_.keyframes.emplace(id, std::move(keyframe));
  return id;
}

void Map::describe(KeyframeId id, std::shared_ptr<const PlaceView> place) {
  Keyframe& described = contents_.keyframes.at(id);
  if (!described.place && place) {
    places_.add(id, *place);
    described.place = std::move(place);
  }
}

void Map::remove_edges(KeyframeId from, KeyframeId to) {
  std::erase_if(contents_.edges,
                [&](const RelativeEdge& e) { return e.from == from && e.to == to; });
}

PointId Map::add_point(MapPoint point) {
  const PointId id{next_point_++};
  contents_.points.emplace(id, std::move(point));
  return id;
}

void Map::observe(PointId id, const Observation& observation) {
  contents_.points.at(id).observations.push_back(observation);
  contents_.keyframes.at(observation.keyframe).points.push_back(id);
}

void Map::remove_point(PointId id) {
  const auto point = contents_.points.find(id);
  if (point == contents_.points.end()) {
    return;
  }
  for (const Observation& observation : point->second.observations) {
    std::erase(contents_.keyframes.at(observation.keyframe).points, id);
  }
  contents_.points.erase(point);
}

void Map::remove_observation(PointId id, KeyframeId keyframe) {
  MapPoint* point = find_point(id);
  if (point == nullptr) {
    return;
  }
  std::erase_if(point->observations, [&](const Observation& o) { return o.keyframe == keyframe; });
  std::erase(contents_.keyframes.at(keyframe).points, id);
  if (point->observations.empty()) {
    contents_.points.erase(id);
  }
}

void Map::move(const std::function<SE3(KeyframeId)>& T_odom1_odom0) {
  for (auto& [id, point] : contents_.points) {
    point.p_odom = T_odom1_odom0(point.observations.front().keyframe) * point.p_odom;
  }
  for (auto& [id, keyframe] : contents_.keyframes) {
    keyframe.T_odom_cam = T_odom1_odom0(id) * keyframe.T_odom_cam;
  }
}

void Map::keep_newest(std::size_t clouds, std::size_t pyramids) {
  std::size_t age = 0;
  for (auto it = contents_.keyframes.rbegin(); it != contents_.keyframes.rend(); ++it, ++age) {
    if (age >= clouds) {
      it->second.cloud.reset();
    }
    if (age >= pyramids) {
      it->second.pyramid.reset();
    }
  }
}

void Map::read_clouds_near(KeyframeId id, double radius_m, std::size_t most) {
  const Keyframe& centre = keyframe(id);
  std::vector<std::pair<double, KeyframeId>> near;
  for (const auto& [other, candidate] : contents_.keyframes) {
    const double distance_m =
        (candidate.T_odom_cam.translation() - centre.T_odom_cam.translation()).norm();
    if (!candidate.cloud && candidate.stored_cloud && candidate.part == centre.part &&
        distance_m < radius_m) {
      near.emplace_back(distance_m, other);
    }
  }
  std::ranges::sort(near);
  near.resize(std::min(near.size(), most));
  for (const auto& [distance_m, other] : near) {
    Keyframe& candidate = keyframe(other);
    if (auto cloud = candidate.stored_cloud->read()) {
      candidate.cloud = std::move(*cloud);
    } else {
      log::warning("map", "a keyframe stays without its depth: {}", cloud.error().message);
      candidate.stored_cloud.reset();
    }
  }
}

MapPoint* Map::find_point(PointId id) {
  const auto point = contents_.points.find(id);
  return point == contents_.points.end() ? nullptr : &point->second;
}

const MapPoint* Map::find_point(PointId id) const {
  const auto point = contents_.points.find(id);
  return point == contents_.points.end() ? nullptr : &point->second;
}

}  // namespace geoflow::slam
