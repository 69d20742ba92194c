#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <span>
#include <utility>

#include <sys/mman.h>
#include <unistd.h>

#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/slam/saved_map.hpp"

#include "cloud/cell_grid.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "reasoned.hpp"
#include "storage/bytes.hpp"
#include "storage/map_codec.hpp"
#include "storage/map_file.hpp"
#include "storage/stored_map.hpp"

namespace slam = geoflow::slam;

namespace {

/// As a file: header, directory and checksums.
void read_file(std::span<const std::byte> bytes) {
  geoflow::UniqueFd fd{::memfd_create("map", MFD_CLOEXEC)};
  if (!fd || ::write(fd.get(), bytes.data(), bytes.size()) != std::ssize(bytes)) {
    return;
  }
  const auto map = slam::MapFile::open(std::move(fd), "fuzz.map").and_then(slam::read_map);
  geoflow::tests::require_reason(map);
  if (map) {
    geoflow::tests::require_reason(slam::check_depth(**map));
  }
}

/// As a section whose checksum is right: the first byte says which.
void read_section(std::span<const std::byte> bytes) {
  static const auto grid = slam::CellGrid::create(
      {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5}, 8);
  static const std::map<slam::KeyframeId, slam::Keyframe> keyframes{{slam::KeyframeId{0}, {}},
                                                                    {slam::KeyframeId{1}, {}}};
  slam::ByteReader reader{bytes.subspan(1)};
  constexpr unsigned kKinds = 6;
  switch (std::to_integer<unsigned>(bytes.front()) % kKinds) {
    case 0:
      (void)slam::decode_identity(reader);
      break;
    case 1:
      (void)slam::decode_points(reader, slam::decode_keyframes(reader));
      break;
    case 2:
      (void)slam::decode_points(reader, keyframes);
      break;
    case 3:
      (void)slam::decode_edges(reader, keyframes);
      break;
    case 4:
      (void)slam::decode_place(reader);
      break;
    default:
      if (slam::decode_cloud(reader, *grid) && !reader.ok()) {
        std::abort();
      }
  }
}

}  // namespace

/// A map file from any bytes. Nothing may be allocated that is not there.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0) {
    read_file(std::as_bytes(std::span{data, size}));
    read_section(std::as_bytes(std::span{data, size}));
  }
  return 0;
}
