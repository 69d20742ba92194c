#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {

/// A firmware version as the camera gives it: 5.12.7.100.
struct FirmwareVersion {
  std::uint8_t major = 0;
  std::uint8_t minor = 0;
  std::uint8_t patch = 0;
  std::uint8_t build = 0;

  friend constexpr auto operator<=>(const FirmwareVersion&, const FirmwareVersion&) = default;
};

/// From there on the IMU reports 32-bit axes (38 bytes), before it 16-bit ones (32 bytes).
inline constexpr FirmwareVersion kWideImuFirmware{.major = 5, .minor = 16, .patch = 0, .build = 0};

struct D435iOptions {
  /// What librealsense calls the serial number, and the USB serial number: 12 hexadecimal digits
  /// each.
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member
  std::string module_serial = "843112070435";
  std::string asic_serial = "843123050435";
  FirmwareVersion firmware{.major = 5, .minor = 12, .patch = 7, .build = 100};
  /// The device clock when the camera gets power [us]. It counts on in 32 bits.
  std::uint64_t clock_start_us = 1'000'000;
  // NOLINTEND(readability-magic-numbers)
};

/// What was done so far. Never decreases.
struct D435iCounters {
  std::uint64_t frames_sent = 0;
  std::uint64_t frames_dropped = 0;  ///< not fetched in time by the host
  std::uint64_t reports_sent = 0;
  std::uint64_t reports_dropped = 0;  ///< as for frames
  std::uint64_t world_errors = 0;     ///< samples that the world could not give
};

/// An Intel RealSense D435i on USB 3 (8086:0b3a): its descriptors, UVC controls, streams and
/// metadata, the hardware monitor with the calibration of the world it looks at, and the IMU's HID
/// sensors. docs/emulator.md says what is known to the byte and what is an assumption. The world's
/// time starts with the first stream and stands still while nothing streams.
class D435i : public UsbDevice {
 public:
  /// Errors name the option or the property of the world that a D435i cannot have.
  [[nodiscard]] static Result<std::unique_ptr<D435i>> create(const D435iOptions& options,
                                                             std::unique_ptr<World> world);

  [[nodiscard]] virtual D435iCounters counters() const = 0;
  /// What is added to the recording's time to get the host's, by the newest sample; it changes
  /// where the world has stood still or begins again. None before the first sample.
  [[nodiscard]] virtual std::optional<Duration> recording_shift() const = 0;
};

}  // namespace geoflow::emulator
