#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"

/// Numbers as bytes, little-endian whatever the host is. IEEE 754 throughout.
namespace geoflow::slam {

/// Appends numbers to a block of bytes. Thread-compatible.
class ByteWriter {
 public:
  template <std::unsigned_integral T>
  void put(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes_.push_back(static_cast<std::byte>(value >> (kByteBits * i)));
    }
  }
  void put(double value) { put(std::bit_cast<std::uint64_t>(value)); }
  void put(float value) { put(std::bit_cast<std::uint32_t>(value)); }
  void put(const Vector2d& value);
  void put(const Vector3d& value);
  void put(const Matrix6d& value);
  void put(const SE3& value);
  /// At most kLongestText bytes of it.
  void put(std::string_view text);
  /// Of a list whose entries follow.
  void put_count(std::size_t count) { put(static_cast<std::uint32_t>(count)); }

  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  static constexpr unsigned kByteBits = std::numeric_limits<unsigned char>::digits;
  std::vector<std::byte> bytes_;
};

inline constexpr std::size_t kLongestText = 4096;

/// Reads them again. The first thing that is wrong is kept; from then on every number is 0, so
/// that callers may look once, at the end. Borrows the bytes. Thread-compatible.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_{bytes} {}

  template <std::unsigned_integral T>
  [[nodiscard]] T get() {
    T value = 0;
    if (sizeof(T) > left()) {
      fail("ends too early");
      return value;
    }
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      value = static_cast<T>(value | static_cast<T>(bytes_[offset_ + i]) << (kByteBits * i));
    }
    offset_ += sizeof(T);
    return value;
  }
  [[nodiscard]] std::uint32_t u32() { return get<std::uint32_t>(); }
  /// Finite numbers; others are wrong.
  [[nodiscard]] double f64();
  [[nodiscard]] float f32();
  [[nodiscard]] Vector2d vector2();
  [[nodiscard]] Vector3d vector3();
  [[nodiscard]] Matrix6d matrix6();
  /// The rotation must have a norm of 1, up to rounding.
  [[nodiscard]] SE3 pose();
  [[nodiscard]] std::string text();
  /// Length of a list whose entries take at least so many bytes: never more than are there.
  [[nodiscard]] std::size_t count(std::size_t least_entry_bytes);

  void fail(std::string_view what);
  [[nodiscard]] bool ok() const noexcept { return wrong_.empty(); }
  [[nodiscard]] const std::string& wrong() const noexcept { return wrong_; }
  /// Where the first wrong thing is, or the next number.
  [[nodiscard]] std::size_t offset() const noexcept { return offset_; }
  [[nodiscard]] std::size_t left() const noexcept { return ok() ? bytes_.size() - offset_ : 0; }

 private:
  static constexpr unsigned kByteBits = std::numeric_limits<unsigned char>::digits;
  std::span<const std::byte> bytes_;
  std::size_t offset_ = 0;
  std::string wrong_;
};

}  // namespace geoflow::slam
