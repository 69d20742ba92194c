#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "replay/scannet/format.hpp"
#include "replay/scannet/geometry.hpp"

namespace scannet = geoflow::drivers::scannet;

/// Larger images only cost time.
constexpr int kLargestArea = 1 << 16;

/// A `.sens` file from any bytes: its header, then the first frame's pose and depth image. What is
/// accepted must be finite and of the declared size.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  const auto header = scannet::parse_header("scene.sens", bytes);
  if (!header || header->depth.width > kLargestArea / header->depth.height ||
      bytes.size() - header->size_bytes < scannet::kFrameHeaderBytes) {
    return 0;
  }
  const auto rest = bytes.subspan(header->size_bytes);
  const auto frame = scannet::parse_frame_header(rest.first<scannet::kFrameHeaderBytes>());
  if (frame.T_world_depth && !frame.T_world_depth->translation().allFinite()) {
    std::abort();
  }
  const auto depth = scannet::decode_depth(*header, rest.subspan(scannet::kFrameHeaderBytes));
  if (depth) {
    const auto moved = scannet::register_depth(*depth, header->depth, header->depth,
                                               header->T_color_depth, header->depth_counts_per_m);
    if (moved.size() != depth->size()) {
      std::abort();
    }
  }
  return 0;
}
