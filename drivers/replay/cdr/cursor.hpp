#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

/// Plain CDR (XCDR1) as ROS 2 writes it: a 4-byte encapsulation header, then values aligned to
/// their own size, counted from the end of that header. Source: OMG DDS-XTypes 1.3, 7.4.1
/// and 7.6.2.
namespace geoflow::drivers::cdr {

/// A value of 1, 2, 4 or 8 bytes that is stored as such.
template <typename T>
concept Scalar = std::is_arithmetic_v<T>;

/// A struct that lists its members in wire order.
template <typename T>
concept Composite = requires(T& value) { T::fields(value); };

inline constexpr std::size_t kEncapsulationBytes = 4;

/// Walks through one message. The first thing that does not fit makes it fail for good: later reads
/// leave their target as it is, so that callers check once, at the end. Never allocates more than a
/// small multiple of the message's size.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> message);

  template <Scalar T>
  void read(T& value) {
    if (const std::byte* source = take(sizeof(T), sizeof(T))) {
      load(source, value);
    }
  }
  template <Composite T>
  void read(T& value) {
    std::apply([this](auto&... member) { (this->read(member), ...); }, T::fields(value));
  }
  template <typename T, std::size_t Size>
  void read(std::array<T, Size>& values) {
    for (T& value : values) {
      read(value);
    }
  }
  template <typename T>
  void read(std::vector<T>& values) {
    values.clear();
    for (std::size_t left = read_length(kLeastBytes<T>); left > 0 && !error_; --left) {
      read(values.emplace_back());
    }
  }
  void read(std::string& text);
  /// A view of the bytes where they lie.
  void read(std::span<const std::byte>& bytes);

  /// What did not fit and at which byte of the message; none while all is well.
  [[nodiscard]] const std::optional<std::string>& error() const noexcept { return error_; }
  [[nodiscard]] std::size_t remaining() const noexcept { return message_.size() - at_; }

 private:
  /// The fewest bytes that an element of a sequence takes up.
  template <typename T>
  static constexpr std::size_t kLeastBytes = Scalar<T> ? sizeof(T) : sizeof(std::uint32_t);

  template <Scalar T>
  void load(const std::byte* source, T& value) const {
    std::array<std::byte, sizeof(T)> bytes{};
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes[i] = source[swap_ ? sizeof(T) - 1 - i : i];
    }
    if constexpr (std::same_as<T, bool>) {
      value = bytes[0] != std::byte{0};
    } else {
      value = std::bit_cast<T>(bytes);
    }
  }
  /// The next `size` bytes after aligning, or null (and failed) where the message ends before.
  const std::byte* take(std::size_t alignment, std::size_t size);
  /// A sequence's length; 0 and failed where that many elements cannot be left.
  std::size_t read_length(std::size_t least_bytes_each);
  void set_error(std::string what);

  std::span<const std::byte> message_;
  std::size_t at_ = 0;
  bool swap_ = false;
  std::optional<std::string> error_;
};

/// Builds one little-endian message; the counterpart of Reader.
class Writer {
 public:
  Writer();

  template <Scalar T>
  void write(T value) {
    const auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
    static_assert(std::endian::native == std::endian::little);
    append(sizeof(T), bytes);
  }
  template <Composite T>
  void write(const T& value) {
    std::apply([this](const auto&... member) { (this->write(member), ...); }, T::fields(value));
  }
  template <typename T, std::size_t Size>
  void write(const std::array<T, Size>& values) {
    for (const T& value : values) {
      write(value);
    }
  }
  template <typename T>
  void write(const std::vector<T>& values) {
    write(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) {
      write(value);
    }
  }
  void write(const std::string& text);
  void write(std::span<const std::byte> bytes);

  [[nodiscard]] std::vector<std::byte> take() && { return std::move(message_); }

 private:
  void append(std::size_t alignment, std::span<const std::byte> bytes);

  std::vector<std::byte> message_;
};

}  // namespace geoflow::drivers::cdr
