#include "storage/stored_map.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/stored_cloud.hpp"
#include "storage/bytes.hpp"
#include "storage/map_codec.hpp"
#include "storage/map_file.hpp"

namespace geoflow::slam {
namespace {

/// Decodes all of a section.
template <typename Decode>
auto decode_section(const MapFile& file, const Section& section, const Decode& decode)
    -> Result<decltype(decode(std::declval<ByteReader&>()))> {
  const auto bytes = file.read(section);
  if (!bytes) {
    return tl::unexpected{bytes.error()};
  }
  ByteReader reader{*bytes};
  auto decoded = decode(reader);
  if (reader.left() > 0) {
    reader.fail("there is more than belongs there");
  }
  if (!reader.ok()) {
    return file.wrong(section, reader.offset(), reader.wrong());
  }
  return decoded;
}

/// A cloud in a map file.
class CloudInFile final : public StoredCloud {
 public:
  CloudInFile(std::shared_ptr<const MapFile> file, const Section& section,
              std::shared_ptr<const CellGrid> grid)
      : file_{std::move(file)}, section_{section}, grid_{std::move(grid)} {}

  [[nodiscard]] Result<std::shared_ptr<const DepthCloud>> read() const override {
    return decode_section(*file_, section_,
                          [&](ByteReader& reader) { return decode_cloud(reader, grid_); });
  }
  [[nodiscard]] Result<std::vector<std::byte>> bytes() const override {
    return file_->read(section_);
  }

 private:
  std::shared_ptr<const MapFile> file_;
  Section section_;
  std::shared_ptr<const CellGrid> grid_;
};

/// Reads a map section by section, in the order of the file.
class MapReader {
 public:
  explicit MapReader(std::shared_ptr<const MapFile> file) : file_{std::move(file)} {}

  [[nodiscard]] Result<std::shared_ptr<const StoredMap>> read() {
    constexpr std::array kOrder{SectionTag::kIdentity, SectionTag::kKeyframes, SectionTag::kPoints,
                                SectionTag::kEdges, SectionTag::kJoins};
    std::size_t next = 0;
    for (const Section& section : file_->sections()) {
      const bool of_keyframe =
          section.tag == SectionTag::kPlace || section.tag == SectionTag::kCloud;
      if (of_keyframe ? next != kOrder.size()
                      : next == kOrder.size() || section.tag != kOrder.at(next)) {
        return file_->wrong(section, 0, "is not expected here");
      }
      next += of_keyframe ? 0U : 1U;
      auto taken = of_keyframe ? take_of_keyframe(section) : take(section);
      if (!taken) {
        return tl::unexpected{std::move(taken.error())};
      }
    }
    if (next != kOrder.size()) {
      return fail(ErrorCode::kInvalidData, "{}: section {} is missing", file_->name(),
                  to_string(kOrder.at(next)));
    }
    return map_;
  }

 private:
  template <typename T, typename Decode>
  [[nodiscard]] Result<void> take(const Section& section, T& into, const Decode& decode) {
    auto decoded = decode_section(*file_, section, decode);
    if (!decoded) {
      return tl::unexpected{std::move(decoded.error())};
    }
    into = std::move(*decoded);
    return {};
  }

  [[nodiscard]] Result<void> take(const Section& section) {
    MapContents& contents = map_->contents;
    const auto edges = [&](ByteReader& reader) { return decode_edges(reader, contents.keyframes); };
    switch (section.tag) {
      case SectionTag::kIdentity:
        return take(section, map_->identity, decode_identity).and_then([&] {
          return make_grid(section);
        });
      case SectionTag::kKeyframes:
        return take(section, contents.keyframes, decode_keyframes);
      case SectionTag::kPoints:
        return take(section, contents.points,
                    [&](ByteReader& reader) { return decode_points(reader, contents.keyframes); });
      case SectionTag::kEdges:
        return take(section, contents.edges, edges);
      case SectionTag::kJoins:
        return take(section, contents.joins, edges);
      case SectionTag::kPlace:
      case SectionTag::kCloud:
        break;
    }
    return take_of_keyframe(section);
  }

  [[nodiscard]] Result<void> make_grid(const Section& section) {
    auto grid = CellGrid::create(map_->identity.calibration.camera, DepthCloudConfig{}.cell_px);
    if (!grid) {
      return file_->wrong(section, 0, grid.error().message);
    }
    grid_ = std::move(*grid);
    return {};
  }

  [[nodiscard]] Result<void> take_of_keyframe(const Section& section) {
    const auto found = map_->contents.keyframes.find(KeyframeId{section.key});
    if (found == map_->contents.keyframes.end()) {
      return file_->wrong(section, 0, "belongs to a keyframe that is not there");
    }
    Keyframe& keyframe = found->second;
    if (section.tag == SectionTag::kPlace ? keyframe.place != nullptr
                                          : keyframe.stored_cloud != nullptr) {
      return file_->wrong(section, 0, "is there twice");
    }
    if (section.tag == SectionTag::kPlace) {
      return take(section, keyframe.place, decode_place);
    }
    keyframe.stored_cloud = std::make_shared<const CloudInFile>(file_, section, grid_);
    return {};
  }

  std::shared_ptr<const MapFile> file_;
  std::shared_ptr<StoredMap> map_ = std::make_shared<StoredMap>();
  std::shared_ptr<const CellGrid> grid_;
};

bool same_pose(const SE3& T_a_b, const SE3& T_a_b1) {
  constexpr double kRounding = 1e-9;
  return (T_a_b.inverse() * T_a_b1).log().norm() < kRounding;
}

bool same_camera(const CameraIntrinsics& a, const CameraIntrinsics& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.model == b.model && a.distortion == b.distortion;
}

}  // namespace

StoredMap snapshot(const Map& map, const Calibration& calibration) {
  StoredMap stored{.identity = {.made_by = GEOFLOW_VERSION, .calibration = calibration},
                   .contents = map.contents()};
  for (auto& [id, keyframe] : stored.contents.keyframes) {
    keyframe.pyramid.reset();
  }
  return stored;
}

Result<std::shared_ptr<const StoredMap>> read_map(const std::shared_ptr<const MapFile>& file) {
  return MapReader{file}.read();
}

Result<std::shared_ptr<const StoredMap>> load_map(const std::filesystem::path& path) {
  return MapFile::open(path).and_then(read_map);
}

Result<void> check_depth(const StoredMap& map) {
  for (const auto& [id, keyframe] : map.contents.keyframes) {
    if (keyframe.stored_cloud) {
      const auto cloud = keyframe.stored_cloud->read();
      if (!cloud) {
        return tl::unexpected{cloud.error()};
      }
    }
  }
  return {};
}

Result<void> made_with(const StoredMap& map, const Calibration& calibration) {
  const Calibration& made = map.identity.calibration;
  const auto refuse = [](std::string_view what) {
    return fail(ErrorCode::kInvalidArgument, "the map was made with another {}", what);
  };
  if (!made.serial.empty() && !calibration.serial.empty() && made.serial != calibration.serial) {
    return fail(ErrorCode::kInvalidArgument, "the map was made with camera {}, and this one is {}",
                made.serial, calibration.serial);
  }
  if (!same_camera(made.camera, calibration.camera)) {
    return refuse("calibration of the camera");
  }
  if (made.depth_unit_m != calibration.depth_unit_m ||
      made.depth_alignment != calibration.depth_alignment) {
    return refuse("kind of depth images");
  }
  if (!same_pose(made.T_base_cam.value_or(SE3{}), calibration.T_base_cam.value_or(SE3{}))) {
    return refuse("place of the camera on the robot");
  }
  return {};
}

Result<void> save_map(const StoredMap& map, const std::filesystem::path& path) {
  const MapContents& contents = map.contents;
  std::vector<SectionToWrite> sections;
  const auto add = [&](SectionTag tag, std::uint32_t key, auto bytes) {
    sections.push_back({.tag = tag, .key = key, .bytes = std::move(bytes)});
  };
  add(SectionTag::kIdentity, 0, [&] { return encode(map.identity); });
  add(SectionTag::kKeyframes, 0, [&] { return encode(contents.keyframes); });
  add(SectionTag::kPoints, 0, [&] { return encode(contents.points); });
  add(SectionTag::kEdges, 0, [&] { return encode(contents.edges); });
  add(SectionTag::kJoins, 0, [&] { return encode(contents.joins); });
  for (const auto& [id, keyframe] : contents.keyframes) {
    const auto key = static_cast<std::uint32_t>(id);
    const Keyframe* kept = &keyframe;
    if (keyframe.place) {
      add(SectionTag::kPlace, key, [kept] { return encode(*kept->place); });
    }
    if (keyframe.stored_cloud) {
      add(SectionTag::kCloud, key, [kept] { return kept->stored_cloud->bytes(); });
    } else if (keyframe.cloud) {
      add(SectionTag::kCloud, key, [kept] { return encode(*kept->cloud); });
    }
  }
  return write_map_file(path, sections);
}

}  // namespace geoflow::slam
