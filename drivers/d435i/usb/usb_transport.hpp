#pragma once

#include <cstdint>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"
#include "usb/port.hpp"

namespace geoflow::drivers::d435i {

inline constexpr std::uint16_t kVendor = 0x8086;
inline constexpr std::uint16_t kProduct = 0x0b3a;

/// The camera over USB itself: extension unit, probe and commit, bulk payloads, HID reports. Takes
/// the interfaces that it needs. Errors: the port's, and kUnsupported where the descriptors are not
/// a D435i's.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_usb_transport(
    std::unique_ptr<usb::Port> port);

}  // namespace geoflow::drivers::d435i
