#pragma once

#include <optional>
#include <vector>

#include <OniCTypes.h>

#include "d435i/core/transport.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::openni2 {

/// What the camera has of a stream, as OpenNI says it: depth in millimetres; colour as RGB888, YUYV
/// and GRAY8. Pure, as the others.
[[nodiscard]] std::vector<OniVideoMode> oni_modes(const std::vector<d435i::VideoMode>& modes,
                                                  d435i::VideoStream stream);

/// The mode that a stream begins with: 640x480 at 30 Hz if it has that, else its first one. None
/// where there are none.
[[nodiscard]] std::optional<OniVideoMode> default_mode(const std::vector<OniVideoMode>& modes);

[[nodiscard]] d435i::VideoMode camera_mode(const OniVideoMode& mode, d435i::VideoStream stream);

[[nodiscard]] bool equal(const OniVideoMode& a, const OniVideoMode& b);

}  // namespace geoflow::drivers::openni2
