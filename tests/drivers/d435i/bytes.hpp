#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

/// Bytes as a device sends them, written down by hand.
namespace geoflow::drivers::d435i::tests {

using Bytes = std::vector<std::byte>;

/// "0a 1b 2c" as bytes; blanks are ignored.
[[nodiscard]] Bytes from_hex(std::string_view text);

/// Appends little-endian numbers.
class Builder {
 public:
  Builder& u8(std::initializer_list<unsigned> values);
  Builder& u16(unsigned value) { return number(value, 2); }
  Builder& u32(std::uint64_t value) { return number(value, 4); }
  Builder& u64(std::uint64_t value) { return number(value, 8); }
  Builder& f32(float value);
  Builder& f32s(std::initializer_list<float> values);
  Builder& hex(std::string_view text);
  Builder& bytes(std::span<const std::byte> more);
  Builder& zeros(std::size_t count);

  [[nodiscard]] std::size_t size() const { return built_.size(); }
  [[nodiscard]] const Bytes& get() const { return built_; }

 private:
  Builder& number(std::uint64_t value, int count);

  Bytes built_;
};

/// The bitwise CRC-32 of IEEE 802.3 (polynomial 0xEDB88320, reflected).
[[nodiscard]] std::uint32_t plain_crc32(std::span<const std::byte> bytes);

}  // namespace geoflow::drivers::d435i::tests
