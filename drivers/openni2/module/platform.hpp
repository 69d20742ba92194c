#pragma once

#include <string>
#include <vector>

#include "d435i/core/transport.hpp"

/// Where the module's cameras come from: its one seam. A module for tests links another definition.
namespace geoflow::drivers::openni2 {

/// The serial numbers, as USB shows them, of the cameras that are plugged in.
[[nodiscard]] std::vector<std::string> connected_cameras();

/// The way to a camera of such a serial number.
[[nodiscard]] d435i::OpenTransport camera_opener();

}  // namespace geoflow::drivers::openni2
