#pragma once

#include <cstdint>

#include "geoflow/tools/emulator/byte_writer.hpp"

#include "src/uvc_controls.hpp"

namespace geoflow::emulator {

/// What a frame's metadata says that its stream decides. Times [us] of the device clock.
struct FrameFacts {
  bool color = false;   ///< else depth or infrared
  bool odd = false;     ///< the frame id bit
  bool failed = false;  ///< the error bit
  bool bare = false;    ///< without metadata: the standard 12 bytes only
  std::uint32_t counter = 0;
  std::uint64_t stamp_us = 0;           ///< when the frame is sent: PTS
  std::uint32_t since_exposure_us = 0;  ///< from the middle of the exposure to the stamp
  std::uint32_t interval_us = 0;
  std::uint16_t format_code = 0;
  std::uint16_t width = 0;
  std::uint16_t height = 0;
  std::uint16_t fps = 0;
};

/// Appends the UVC payload header (UVC 1.5, 2.4.3.3) with the D4xx metadata blocks behind it: 232
/// bytes in all for depth and infrared, 244 for colour. Source: kernel documentation metafmt-d4xx,
/// librealsense's structures. What controls say is read from `controls`.
void put_payload_header(const FrameFacts& facts, const UvcControls& controls, ByteWriter& to);

}  // namespace geoflow::emulator
