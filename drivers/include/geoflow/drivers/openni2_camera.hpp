#pragma once

#include <memory>
#include <string>

#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers {

/// Which device of OpenNI2's, in which mode.
struct OpenNi2Options {
  std::string uri{};  ///< OpenNI's name of a device, or an .oni file; empty: the first device
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member
  int width = 640;   ///< of colour and depth [px]
  int height = 480;  ///< [px]
  int rate_hz = 30;
  // NOLINTEND(readability-magic-numbers)
  bool color_as_gray = false;  ///< kGray8 instead of kBgr8
};

/// Any depth camera that OpenNI2 has a driver for, behind the ports (docs/openni2.md); an .oni file
/// plays at its own pace, once, in the modes that it has, and run() returns at its end. Depth is
/// registered to colour by the device where it can do that. Intrinsics are those of the fields of
/// view that it names, without distortion and with the centre in the middle: a calibration of its
/// own is better. It has no IMU. A device that is silent for three seconds or gone is looked for
/// every two seconds.
///
/// kNotFound where there is no such device; kUnsupported for a program built without OpenNI2, and
/// where it lacks colour, depth or such a mode (the error lists those it has); kInvalidData for a
/// damaged .oni file (naming the byte), which OpenNI's own player would believe; kSystem for what
/// else OpenNI refuses.
[[nodiscard]] Result<std::unique_ptr<LiveCamera>> open_openni2_camera(
    const OpenNi2Options& options);

}  // namespace geoflow::drivers
