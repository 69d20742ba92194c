#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// Appends fields to bytes, least significant byte first, as USB has them. A value type.
class ByteWriter {
 public:
  /// Any integer, in as many bytes as its type has.
  template <std::integral Integer>
  ByteWriter& put(Integer value) {
    auto rest = std::uint64_t{static_cast<std::make_unsigned_t<Integer>>(value)};
    for (std::size_t i = 0; i < sizeof(Integer); ++i) {
      constexpr unsigned kByteBits = 8;
      bytes_.push_back(static_cast<std::byte>(rest));
      rest >>= kByteBits;
    }
    return *this;
  }
  ByteWriter& put(float value) { return put(std::bit_cast<std::uint32_t>(value)); }
  /// One byte, from a constant whose type would be int.
  ByteWriter& u8(unsigned value) { return put(static_cast<std::uint8_t>(value)); }
  ByteWriter& u16(unsigned value) { return put(static_cast<std::uint16_t>(value)); }
  ByteWriter& u32(std::uint64_t value) { return put(static_cast<std::uint32_t>(value)); }
  ByteWriter& bytes(std::span<const std::byte> values) {
    bytes_.insert(bytes_.end(), values.begin(), values.end());
    return *this;
  }
  ByteWriter& bytes(std::span<const std::uint8_t> values) { return bytes(std::as_bytes(values)); }
  ByteWriter& text(std::string_view values) {
    return bytes(std::as_bytes(std::span{values.data(), values.size()}));
  }
  /// Zeros up to `size` bytes in all; nothing where there are as many already.
  ByteWriter& pad_to(std::size_t size) {
    if (bytes_.size() < size) {
      bytes_.resize(size);
    }
    return *this;
  }

  void reserve(std::size_t size) { bytes_.reserve(size); }
  [[nodiscard]] std::size_t size() const noexcept { return bytes_.size(); }
  [[nodiscard]] const Bytes& view() const noexcept { return bytes_; }
  /// Gives the bytes away; empty afterwards.
  [[nodiscard]] Bytes take() noexcept { return std::exchange(bytes_, {}); }

 private:
  Bytes bytes_;
};

}  // namespace geoflow::emulator
