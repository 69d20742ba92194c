#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {

/// A firmware's version, most significant part first: 5.12.7.100.
struct FirmwareVersion {
  std::array<std::uint8_t, 4> parts{};

  [[nodiscard]] std::string text() const;
  friend auto operator<=>(const FirmwareVersion&, const FirmwareVersion&) = default;
};

/// What the camera says of itself (GVD).
struct Versions {
  FirmwareVersion firmware;
  std::string serial;       ///< of the optical module: the number on the label
  std::string asic_serial;  ///< what USB shows as serial number
  bool has_color = false;
  bool has_imu = false;
};

/// Reads the answer to Opcode::kVersions. kInvalidData where it is short. Pure.
/// Source: librealsense, src/ds/d400/d400-private.h.
[[nodiscard]] Result<Versions> parse_versions(std::span<const std::byte> data);

}  // namespace geoflow::drivers::d435i
