#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "d435i/uvc/descriptors.hpp"

/// What goes over the wire while a UVC stream is agreed and runs.
///
/// Source: USB Device Class Definition for Video Devices 1.5, 2.4.3.3 (payload header) and 4.3.1.1
/// (probe and commit).
namespace geoflow::drivers::d435i {

/// The header before each payload. The D435i sends one payload a frame and puts its metadata behind
/// the standard fields, inside the header's length.
struct PayloadHeader {
  std::uint8_t length = 0;  ///< with metadata
  bool frame_id = false;    ///< toggles with each frame
  bool end_of_frame = false;
  bool error = false;
  std::optional<std::uint32_t> pts_us{};  ///< presentation time: the camera counts microseconds
  std::span<const std::byte> metadata{};  ///< the bytes behind the standard fields; borrowed
};

/// Reads the header at the front of `payload`. kInvalidData where its length does not hold its own
/// fields or is more than there is. Pure.
[[nodiscard]] Result<PayloadHeader> parse_payload_header(std::span<const std::byte> payload);

/// The stream parameters that host and camera agree on.
struct ProbeCommit {
  std::uint16_t hint = 0;
  std::uint8_t format_index = 0;
  std::uint8_t frame_index = 0;
  std::uint32_t interval_100ns = 0;
  std::uint32_t max_frame_bytes = 0;
  std::uint32_t max_payload_bytes = 0;
};

/// Length of the block: 26 bytes in UVC 1.0, 34 in 1.1, 48 from 1.5 on.
[[nodiscard]] std::size_t probe_bytes(std::uint16_t uvc_version) noexcept;

/// The block that asks for `choice`, everything else being left to the camera.
[[nodiscard]] std::vector<std::byte> encode_probe(const ModeChoice& choice,
                                                  std::uint16_t uvc_version);

/// kInvalidData where the block is shorter than that of UVC 1.0. Pure.
[[nodiscard]] Result<ProbeCommit> parse_probe(std::span<const std::byte> block);

}  // namespace geoflow::drivers::d435i
