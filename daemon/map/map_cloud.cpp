#include "map/map_cloud.hpp"

#include <algorithm>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::daemon {
namespace {

constexpr double kCellM = 0.05;

geoflow_point to_point(const slam::MapSurfel& surfel) {
  const Eigen::Vector3f p = surfel.p_map.cast<float>();
  const Eigen::Vector3f normal = surfel.normal_map.cast<float>();
  return {.p_map = {p.x(), p.y(), p.z()},
          .normal_map = {normal.x(), normal.y(), normal.z()},
          .sigma_m = static_cast<float>(surfel.sigma_m)};
}

}  // namespace

Result<MapCloud> make_cloud(const slam::StoredMap& map) {
  double cell_m = kCellM;
  auto surfels = slam::planes(map, cell_m);
  while (surfels && surfels->size() > kMostCloudPoints) {
    cell_m *= 2;
    surfels = slam::planes(map, cell_m);
  }
  return surfels.map([](const std::vector<slam::MapSurfel>& all) {
    MapCloud cloud(all.size());
    std::ranges::transform(all, cloud.begin(), to_point);
    return cloud;
  });
}

}  // namespace geoflow::daemon
