#include "src/options.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/emulator/d435i.hpp"

namespace geoflow::emulator {
namespace {

bool is_serial(const std::string& text) {
  constexpr std::size_t kDigits = 12;
  return text.size() == kDigits &&
         std::ranges::all_of(text, [](unsigned char c) { return std::isxdigit(c) != 0; });
}

}  // namespace

Result<void> check_options(const D435iOptions& options, const Calibration& calibration) {
  constexpr std::uint8_t kFamily = 5;
  constexpr std::uint8_t kMostPatch = 15;
  constexpr double kMicrometresPerMetre = 1e6;
  constexpr double kRounding = 1e-6;
  for (const std::string& serial : {options.module_serial, options.asic_serial}) {
    if (!is_serial(serial)) {
      return fail(ErrorCode::kInvalidArgument,
                  "serial number '{}': a D435i's has 12 hexadecimal digits", serial);
    }
  }
  if (options.firmware.major != kFamily || options.firmware.patch > kMostPatch) {
    return fail(ErrorCode::kInvalidArgument,
                "firmware {}.{}.{}.{}: a D435i's is 5.MINOR.PATCH.BUILD with a patch below 16",
                options.firmware.major, options.firmware.minor, options.firmware.patch,
                options.firmware.build);
  }
  const CameraIntrinsics& camera = calibration.camera;
  if (camera.width <= 0 || camera.height <= 0 || !(camera.fx > 0) || !(camera.fy > 0)) {
    return fail(ErrorCode::kInvalidData, "{}: no camera: {} x {} pixels, focal lengths {} and {}",
                calibration.source, camera.width, camera.height, camera.fx, camera.fy);
  }
  const double unit = calibration.depth_unit_m * kMicrometresPerMetre;
  if (!(unit > 0.5) || std::abs(unit - std::round(unit)) > kRounding) {
    return fail(ErrorCode::kInvalidData,
                "{}: a unit of depth of {} m is not the whole micrometres that a D435i can say",
                calibration.source, calibration.depth_unit_m);
  }
  return {};
}

}  // namespace geoflow::emulator
