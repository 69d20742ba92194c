#include "view/map_scene.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kMostSurfels = 100'000;
constexpr double kSmallestCell_m = 0.05;
constexpr std::array<char, 4> kMagic = {'G', 'F', 'V', 'M'};
constexpr std::uint32_t kVersion = 1;

static_assert(std::numeric_limits<float>::is_iec559);
static_assert(std::endian::native == std::endian::little);

/// Numbers one behind the other, as a browser's typed arrays take them.
class Bytes {
 public:
  void add(std::uint32_t value) { append(&value, sizeof value); }
  void add(const Vector3d& vector) {
    for (const double value : vector) {
      add(static_cast<float>(value));
    }
  }
  void add(float value) { append(&value, sizeof value); }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  void append(const void* value, std::size_t size) {
    std::array<char, sizeof(std::uint32_t)> raw{};
    std::memcpy(raw.data(), value, size);
    bytes_.append(raw.data(), size);
  }
  std::string bytes_{kMagic.begin(), kMagic.end()};
};

Result<std::vector<slam::MapSurfel>> few_surfels(const slam::StoredMap& map) {
  double cell_m = kSmallestCell_m;
  auto surfels = slam::planes(map, cell_m);
  while (surfels && surfels->size() > kMostSurfels) {
    cell_m *= 2;
    surfels = slam::planes(map, cell_m);
  }
  return surfels;
}

void add_pose(Bytes& bytes, const SE3& pose) {
  bytes.add(pose.translation());
  const Eigen::Quaterniond& q = pose.rotation();
  for (const double value : {q.x(), q.y(), q.z(), q.w()}) {
    bytes.add(static_cast<float>(value));
  }
}

Result<std::string> encode(const slam::StoredMap& map) {
  const auto surfels = few_surfels(map);
  if (!surfels) {
    return tl::unexpected{surfels.error()};
  }
  const Trajectory keyframes = slam::keyframe_poses(map);
  const std::vector<Vector3d> points = slam::sparse_points(map);
  const std::vector<slam::MapLoop> loops = slam::loops(map);
  Bytes bytes;
  bytes.add(kVersion);
  for (const std::size_t count : {keyframes.size(), points.size(), surfels->size(), loops.size()}) {
    bytes.add(static_cast<std::uint32_t>(count));
  }
  for (const auto& keyframe : keyframes) {
    add_pose(bytes, keyframe.pose);
  }
  for (const Vector3d& point : points) {
    bytes.add(point);
  }
  for (const slam::MapSurfel& surfel : *surfels) {
    bytes.add(surfel.p_map);
    bytes.add(surfel.normal_map);
  }
  for (const slam::MapLoop& loop : loops) {
    bytes.add(loop.p_map_from);
    bytes.add(loop.p_map_to);
  }
  return bytes.take();
}

}  // namespace

void MapScene::show(const std::filesystem::path& file) {
  const std::scoped_lock lock{mutex_};
  file_ = file;
  ++version_;
  bytes_.reset();
}

Result<std::shared_ptr<const std::string>> MapScene::bytes() {
  const std::scoped_lock reading{reading_};
  std::filesystem::path file;
  std::uint64_t version = 0;
  {
    const std::scoped_lock lock{mutex_};
    if (bytes_) {
      return bytes_;
    }
    file = file_;
    version = version_;
  }
  if (file.empty()) {
    return fail(ErrorCode::kNotFound, "no map has been saved yet");
  }
  const auto map = slam::load_map(file);
  auto encoded = map ? encode(**map) : tl::unexpected{map.error()};
  if (!encoded) {
    return tl::unexpected{std::move(encoded).error()};
  }
  auto bytes = std::make_shared<const std::string>(*std::move(encoded));
  const std::scoped_lock lock{mutex_};
  if (version == version_) {
    bytes_ = bytes;
  }
  return bytes;
}

}  // namespace geoflow::tools
