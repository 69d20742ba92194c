#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

/// Little-endian fields, packed, as devices and files have them.
namespace geoflow::drivers {

static_assert(std::endian::native == std::endian::little);

template <typename T>
concept Field = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;

/// Takes fields off the front of a record. The first one that is not there makes it fail for good:
/// from then on every field is 0 and every span empty, so that callers check once, at the end.
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::byte> record) noexcept : left_{record} {}

  template <Field T>
  T take() noexcept {
    std::array<std::byte, sizeof(T)> bytes{};
    const auto taken = take_bytes(sizeof(T));
    for (std::size_t i = 0; i < taken.size(); ++i) {
      bytes[i] = taken[i];
    }
    return std::bit_cast<T>(bytes);
  }
  template <Field T, std::size_t Size>
  std::array<T, Size> take_array() noexcept {
    std::array<T, Size> values{};
    for (T& value : values) {
      value = take<T>();
    }
    return values;
  }
  std::span<const std::byte> take_bytes(std::size_t count) noexcept {
    if (count > left_.size()) {
      ok_ = false;
      left_ = {};
      return {};
    }
    const auto taken = left_.first(count);
    left_ = left_.subspan(count);
    return taken;
  }
  void skip(std::size_t count) noexcept { (void)take_bytes(count); }

  /// Whether every field so far was there.
  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] std::span<const std::byte> left() const noexcept { return left_; }

 private:
  std::span<const std::byte> left_;
  bool ok_ = true;
};

/// Appends fields to a record.
class FieldWriter {
 public:
  template <Field T>
  FieldWriter& put(T value) {
    const auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
    return put_bytes(bytes);
  }
  FieldWriter& put_bytes(std::span<const std::byte> bytes) {
    for (const std::byte byte : bytes) {
      record_.push_back(byte);
    }
    return *this;
  }
  /// Zeros up to a length of `size` bytes in all.
  FieldWriter& pad_to(std::size_t size) {
    record_.resize(size);
    return *this;
  }
  [[nodiscard]] std::vector<std::byte> take() && { return std::move(record_); }

 private:
  std::vector<std::byte> record_;
};

}  // namespace geoflow::drivers
