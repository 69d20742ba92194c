#pragma once

#include <cstddef>
#include <vector>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::daemon {

/// A map's surfaces, for clients.
using MapCloud = std::vector<geoflow_point>;

inline constexpr std::size_t kMostCloudPoints = 131'072;  ///< 3.5 MiB

/// The surfaces of a map's keyframes, one in a cube of 5 cm or, where that would be too many, of
/// twice or more times as much. Takes time, and reads what of the map's depth is in its file.
/// Errors as of slam::planes(). Any thread.
[[nodiscard]] Result<MapCloud> make_cloud(const slam::StoredMap& map);

}  // namespace geoflow::daemon
