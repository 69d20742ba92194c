#include <cstddef>
#include <cstdint>
#include <string_view>

#include "replay/image_list.hpp"
#include "replay/openloris/imu_merge.hpp"
#include "replay/reader.hpp"

using geoflow::drivers::ImageStream;

/// Lists of images and of stamped vectors, from any bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  const std::string_view text{static_cast<const char*>(bytes), size};
  const auto list = geoflow::drivers::parse_image_list("list", text, ImageStream::kColor);
  const auto associations = geoflow::drivers::parse_associations("list", text);
  const auto vector = geoflow::drivers::openloris::parse_vector(text);
  return list && associations && vector ? 0 : 0;
}
