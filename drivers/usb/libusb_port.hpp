#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "usb/port.hpp"

namespace geoflow::drivers::usb {

/// The devices of that vendor and product which are plugged in now, in order of their place.
/// kSystem where USB cannot be looked at.
[[nodiscard]] Result<std::vector<DeviceInfo>> list_devices(std::uint16_t vendor,
                                                           std::uint16_t product);

/// Opens the one of that serial number (empty: the first) by libusb. kNotFound where there is none;
/// kSystem, with what to do about it, where it may not be opened.
[[nodiscard]] Result<std::unique_ptr<Port>> open_device(std::uint16_t vendor, std::uint16_t product,
                                                        const std::string& serial);

}  // namespace geoflow::drivers::usb
