#include <cstddef>
#include <cstdint>
#include <string_view>

#include "reasoned.hpp"
#include "replay/image_list.hpp"
#include "replay/openloris/imu_merge.hpp"
#include "replay/reader.hpp"

using geoflow::drivers::ImageStream;
using geoflow::tests::require_reason;

/// Lists of images and of stamped vectors, from any bytes; what is refused has a reason.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  const std::string_view text{static_cast<const char*>(bytes), size};
  require_reason(geoflow::drivers::parse_image_list("list", text, ImageStream::kColor));
  require_reason(geoflow::drivers::parse_associations("list", text));
  require_reason(geoflow::drivers::openloris::parse_vector(text));
  return 0;
}
