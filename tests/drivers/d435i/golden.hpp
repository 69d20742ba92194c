#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "d435i/bytes.hpp"

/// What a real D435i sends, from dumps (lsusb -v, linux-kernel list 2023-02-09) and from the
/// layouts that librealsense reads.
namespace geoflow::drivers::d435i::tests {

/// The configuration descriptor of firmware 5.12.7 on USB 3: 3199 bytes.
[[nodiscard]] Bytes golden_configuration();

/// The same camera's on USB 2 (reconstructed): the modes that are left.
[[nodiscard]] Bytes usb2_configuration();

/// A payload header of depth (232 bytes): timing, stats, depth control and configuration.
[[nodiscard]] Bytes golden_depth_header(std::uint32_t pts_us, std::uint32_t frame_counter);

/// Calibration tables as the hardware monitor answers them.
[[nodiscard]] Bytes golden_depth_table();
[[nodiscard]] Bytes golden_color_table();
[[nodiscard]] Bytes golden_versions();

/// Puts a table's header, with its CRC, before `payload`.
[[nodiscard]] Bytes with_table_header(unsigned type, const Bytes& payload);

}  // namespace geoflow::drivers::d435i::tests
