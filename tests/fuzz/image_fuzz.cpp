#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/image.hpp"

#include "replay/decode.hpp"
#include "replay/reader.hpp"

namespace drivers = geoflow::drivers;

/// PNG and JPEG images from any bytes: header, then whole image of at most 64 x 64 pixels.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr int kLargestSide = 64;
  static geoflow::FramePool pool{2};
  const auto bytes = std::as_bytes(std::span{data, size});
  const auto header = drivers::read_header(bytes);
  if (!header || header->width > kLargestSide || header->height > kLargestSide) {
    return 0;
  }
  for (const auto stream : {drivers::ImageStream::kColor, drivers::ImageStream::kDepth}) {
    const drivers::EncodedImage image{
        .stream = stream, .bytes = {bytes.begin(), bytes.end()}, .origin = "fuzz"};
    const auto frame =
        drivers::decode(image, {.color_as_gray = size % 2 == 0},
                        [](const geoflow::ImageShape& shape) { return pool.acquire(shape); });
    if (frame &&
        (frame->shape().width != header->width || frame->shape().height != header->height)) {
      __builtin_trap();
    }
  }
  return 0;
}
