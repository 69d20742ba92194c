#include "map/local_map.hpp"

#include <algorithm>
#include <cstdint>
#include <map>

#include "map/ids.hpp"
#include "map/map.hpp"

namespace geoflow::slam {
namespace {

/// Keyframes so close in time are no loop.
constexpr std::uint32_t kRecent = 20;
/// A keyframe's link with the past is that of the last few, for it is tied to these.
constexpr std::uint32_t kTied = 5;
/// Keyframes are linked by so many common points, as many as make a visual fix; and with their
/// neighbours, which see the same.
constexpr int kLinkingPoints = 15;
constexpr std::uint32_t kNeighbours = 10;

}  // namespace

LocalMap::LocalMap(const Map& map, KeyframeId newest) : newest_{newest} {
  std::map<KeyframeId, int> common;
  const auto tied = [&](KeyframeId id) { return ids_apart(id, newest) < kTied && id <= newest; };
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (!tied(id)) {
      continue;
    }
    for (const PointId point : keyframe.points) {
      for (const Observation& observation : map.find_point(point)->observations) {
        ++common[observation.keyframe];
      }
    }
  }
  for (const auto& [id, points] : common) {
    if (points >= kLinkingPoints) {
      linked_.insert(id);
    }
  }
  for (const auto* edges : {&map.edges(), &map.joins()}) {
    for (const RelativeEdge& edge : *edges) {
      if (tied(edge.from) || tied(edge.to)) {
        linked_.insert(edge.from);
        linked_.insert(edge.to);
      }
    }
  }
}

bool LocalMap::contains(KeyframeId id) const {
  return ids_apart(id, newest_) <= kRecent || std::ranges::any_of(linked_, [&](KeyframeId other) {
           return ids_apart(id, other) <= kNeighbours;
         });
}

}  // namespace geoflow::slam
