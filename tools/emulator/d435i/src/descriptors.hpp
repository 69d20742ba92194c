#pragma once

#include <cstdint>
#include <optional>

#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

inline constexpr std::uint8_t kDepthControlInterface = 0;
inline constexpr std::uint8_t kColorControlInterface = 3;
inline constexpr std::uint8_t kHidInterface = 5;
inline constexpr std::uint8_t kHidEndpoint = 0x86;
inline constexpr std::uint8_t kStatusEndpoint = 0x87;

/// The answer to GET_DESCRIPTOR (USB 3.2, 9.4.3) of the device or, for HID's types, of its
/// interface: `value` is type and index. None: there is no such descriptor.
[[nodiscard]] std::optional<Bytes> descriptor(const D435iOptions& options, std::uint16_t value);

/// Of the IMU: reports 1 (accelerometer), 2 (gyroscope) and 3 (a custom sensor that never speaks),
/// each with a feature report of 9 bytes; `wide` is the layout with 32-bit axes. Reconstructed: the
/// original was never published.
[[nodiscard]] Bytes hid_report_descriptor(bool wide);

}  // namespace geoflow::emulator
