#include "slam/storage/small_map.hpp"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "storage/stored_map.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam::tests {
namespace {

Keyframe keyframe(int n, const Calibration& calibration) {
  auto place = std::make_shared<PlaceView>();
  place->features.push_back({.pixel = {10.0 + n, 20}, .descriptor = {1, 2, 3, ~0ULL}});
  place->p_cam.emplace_back(0.1, 0.2, 1.0 / 3);
  const std::vector<DepthCloud::Stored> surfels{
      {.cell = 1,
       .surfel = {.point = {0.1F, 0, 1}, .normal_variance = 1e-6F, .normal = {0, 0, -1}}},
      {.cell = 3,
       .surfel = {.point = {0.2F, 0, 1.5F}, .normal_variance = 2e-6F, .normal = {0, 0, -1}}}};
  Keyframe made;
  made.t = HostTime{std::chrono::milliseconds{1000 + n}};
  made.T_odom_cam =
      SE3::exp((Vector6d() << 0.1 * n, std::numbers::e, 1.0 / 3, n, 0, 0.1).finished());
  made.covariance = Matrix6d::Identity() / (n + 3);
  made.cloud =
      DepthCloud::restored(CellGrid::create(calibration.camera, DepthCloudConfig{}.cell_px).value(),
                           {.unit_m = calibration.depth_unit_m}, 0.003F, surfels);
  made.place = place;
  return made;
}

}  // namespace

StoredMap small_map(const std::string& name) {
  Calibration calibration;
  calibration.camera = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5};
  calibration.T_base_cam = SE3::exp(Vector6d::Constant(0.3));
  calibration.serial = "0123";
  calibration.source = name;
  Map map;
  const KeyframeId a = map.add_keyframe(keyframe(0, calibration));
  const KeyframeId b = map.add_keyframe(keyframe(1, calibration));
  map.begin_part();
  const KeyframeId c = map.add_keyframe(keyframe(2, calibration));
  for (const KeyframeId seen_from : {b, c}) {
    const PointId point = map.add_point(
        {.p_odom = {1, 2, std::numbers::pi}, .descriptor = {5, 6, 7, 8}, .observations = {}});
    map.observe(point, {.keyframe = seen_from, .pixel = {1, 2}, .depth_m = 0.7});
  }
  map.add_edge({.from = a, .to = b, .T_from_to = SE3{}, .information = Matrix6d::Identity()});
  map.begin_part();
  map.join({.from = a, .to = c, .T_from_to = SE3{}, .information = Matrix6d::Identity()});
  return snapshot(map, calibration);
}

std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream in{path, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream{path, std::ios::binary | std::ios::trunc} << bytes;
}

}  // namespace geoflow::slam::tests
