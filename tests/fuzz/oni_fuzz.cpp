#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <sstream>
#include <string>

#include "replay/oni/depth_codec.hpp"
#include "replay/oni/structure.hpp"

namespace oni = geoflow::drivers::oni;

/// Any bytes as an .oni file, and as a compressed depth image. Frames must lie inside the file, and
/// an image have the size that was asked for.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  std::istringstream file{std::string{bytes.empty() ? "" : std::string(data, data + size)}};
  if (const auto found = oni::read_structure(file, size, "walk.oni")) {
    for (const oni::StoredFrame& frame : found->frames) {
      if (frame.offset > size || frame.bytes > size - frame.offset) {
        std::abort();
      }
    }
  }
  constexpr std::size_t kPixels = 64;
  for (const bool with_table : {false, true}) {
    const auto depth = oni::decode_depth(bytes, with_table, kPixels);
    if (depth && depth->size() != kPixels) {
      std::abort();
    }
  }
  return 0;
}
