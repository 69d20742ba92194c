#pragma once

#include <filesystem>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::usb {

/// Resets the port of the device behind a node of usbfs (/dev/bus/usb/002/005), whose kernel
/// drivers are bound anew. Takes up to a second. Thread-safe.
[[nodiscard]] Result<void> reset_node(const std::filesystem::path& node);

}  // namespace geoflow::drivers::usb
