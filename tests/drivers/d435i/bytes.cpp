#include "d435i/bytes.hpp"

#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

namespace geoflow::drivers::d435i::tests {

Bytes from_hex(std::string_view text) {
  std::string digits;
  for (const char c : text) {
    if (c != ' ' && c != '\n') {
      digits += c;
    }
  }
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    unsigned value = 0;
    std::from_chars(&digits[i], &digits[i] + 2, value, 16);
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

Builder& Builder::u8(std::initializer_list<unsigned> values) {
  for (const unsigned value : values) {
    built_.push_back(static_cast<std::byte>(value));
  }
  return *this;
}

Builder& Builder::number(std::uint64_t value, int count) {
  for (int i = 0; i < count; ++i) {
    built_.push_back(static_cast<std::byte>(value >> (8 * i) & 0xffU));
  }
  return *this;
}

Builder& Builder::f32(float value) {
  return u32(std::bit_cast<std::uint32_t>(value));
}

Builder& Builder::f32s(std::initializer_list<float> values) {
  for (const float value : values) {
    f32(value);
  }
  return *this;
}

Builder& Builder::hex(std::string_view text) {
  return bytes(from_hex(text));
}

Builder& Builder::bytes(std::span<const std::byte> more) {
  built_.insert(built_.end(), more.begin(), more.end());
  return *this;
}

Builder& Builder::zeros(std::size_t count) {
  built_.resize(built_.size() + count);
  return *this;
}

std::uint32_t plain_crc32(std::span<const std::byte> bytes) {
  std::uint32_t crc = 0xffffffffU;
  for (const std::byte byte : bytes) {
    crc ^= std::to_integer<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
    }
  }
  return ~crc;
}

}  // namespace geoflow::drivers::d435i::tests
