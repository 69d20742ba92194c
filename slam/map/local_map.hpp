#pragma once

#include <set>

#include "map/ids.hpp"
#include "map/map.hpp"

namespace geoflow::slam {

/// The part of the map that a new view may be tied to without closing a loop: keyframes near the
/// newest one in time, and those that hang together with them by points or edges, with their
/// neighbours. Where the camera comes back to anything else it has drifted: tied to it at once, the
/// last steps would take up all that the whole way has drifted. A snapshot; thread-safe.
class LocalMap {
 public:
  LocalMap(const Map& map, KeyframeId newest);

  [[nodiscard]] KeyframeId newest() const noexcept { return newest_; }
  [[nodiscard]] bool contains(KeyframeId id) const;

 private:
  KeyframeId newest_;
  std::set<KeyframeId> linked_;
};

}  // namespace geoflow::slam
