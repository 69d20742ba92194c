#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace geoflow::emulator {

/// CRC-32 of IEEE 802.3 (polynomial 0xEDB88320 reflected, initial value and final xor 0xFFFFFFFF),
/// as zlib's.
[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes) noexcept;

}  // namespace geoflow::emulator
