#pragma once

#include <string_view>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator::usbip {

/// The first free port of the kernel's virtual host controller for devices of that speed, from the
/// text of its `status` file: lines of hub, port and state, and more. Errors: no such line.
[[nodiscard]] Result<int> free_port(std::string_view status, UsbSpeed speed);

/// Plugs a device of that speed into this machine's kernel; returns our end of the connection.
/// Errors say what is missing.
[[nodiscard]] Result<UniqueFd> attach_to_kernel(UsbSpeed speed);

}  // namespace geoflow::emulator::usbip
