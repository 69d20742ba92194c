#include "geoflow/tools/emulator/checksum.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace geoflow::emulator {
namespace {

constexpr unsigned kByteBits = 8;
constexpr std::size_t kByteValues = 256;

/// What each value of a byte adds.
constexpr std::array<std::uint32_t, kByteValues> byte_table() {
  constexpr std::uint32_t kPolynomial = 0xEDB88320;
  std::array<std::uint32_t, kByteValues> table{};
  for (std::uint32_t value = 0; value < kByteValues; ++value) {
    std::uint32_t crc = value;
    for (unsigned bit = 0; bit < kByteBits; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? kPolynomial : 0U);
    }
    table[value] = crc;
  }
  return table;
}

}  // namespace

std::uint32_t crc32(std::span<const std::byte> bytes) noexcept {
  static constexpr auto kTable = byte_table();
  constexpr std::uint32_t kByte = 0xff;
  std::uint32_t crc = ~std::uint32_t{0};
  for (const std::byte byte : bytes) {
    crc = (crc >> kByteBits) ^ kTable[(crc ^ std::to_integer<std::uint32_t>(byte)) & kByte];
  }
  return ~crc;
}

}  // namespace geoflow::emulator
