#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "geoflow/hal/result.hpp"

#include "reasoned.hpp"
#include "replay/euroc/reader.hpp"
#include "replay/text.hpp"

namespace text = geoflow::drivers::text;

/// Tables of inertial samples from any bytes; what is accepted must be finite, what is refused has
/// a reason.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  const std::string_view content{static_cast<const char*>(bytes), size};
  const auto done =
      text::for_each_line("imu.csv", content, [](const text::Line& line) -> geoflow::Result<void> {
        const auto sample = geoflow::drivers::euroc::parse_line(line.text);
        if (sample &&
            !(sample->sample.accel_mps2.allFinite() && sample->sample.gyro_radps.allFinite())) {
          std::abort();
        }
        geoflow::tests::require_reason(sample);
        return {};
      });
  geoflow::tests::require_reason(done);
  return 0;
}
