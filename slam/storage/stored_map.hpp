#pragma once

#include "geoflow/hal/calibration.hpp"
#include "geoflow/slam/saved_map.hpp"

#include "map/map.hpp"
#include "storage/map_codec.hpp"
#include "storage/map_file.hpp"

namespace geoflow::slam {

struct StoredMap {
  MapIdentity identity;
  MapContents contents;
};

/// A map as it is now. Shares what is heavy; images are left out.
[[nodiscard]] StoredMap snapshot(const Map& map, const Calibration& calibration);

/// load_map() of a file that is open.
[[nodiscard]] Result<std::shared_ptr<const StoredMap>> read_map(
    const std::shared_ptr<const MapFile>& file);

}  // namespace geoflow::slam
