#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "reasoned.hpp"
#include "replay/calibration/kalibr.hpp"
#include "replay/calibration/writer.hpp"
#include "replay/openloris/calibration.hpp"
#include "replay/reader.hpp"

namespace kalibr = geoflow::drivers::kalibr;
namespace openloris = geoflow::drivers::openloris;

/// YAML calibrations from any bytes; what is accepted must survive being written and read again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  const std::string text{static_cast<const char*>(bytes), size};
  if (const auto chain = kalibr::parse_camchain("chain", text)) {
    if (!kalibr::parse_camchain("again", kalibr::write_camchain(*chain))) {
      std::abort();
    }
  }
  if (const auto noise = kalibr::parse_imu("imu", text)) {
    if (!kalibr::parse_imu("again", kalibr::write_imu(*noise))) {
      std::abort();
    }
  }
  geoflow::tests::require_reason(openloris::parse_sensors("sensors", text));
  geoflow::drivers::FoundCalibration found;
  geoflow::tests::require_reason(openloris::parse_transforms("transforms", text, found));
  return 0;
}
