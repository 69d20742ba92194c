#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace geoflow::drivers::can::dbc {

enum class ByteOrder : std::uint8_t {
  kIntel,     ///< little endian; the start bit is the least significant one (`@1`)
  kMotorola,  ///< big endian; the start bit is the most significant one (`@0`)
};

enum class ValueType : std::uint8_t { kUnsigned, kSigned, kFloat32, kFloat64 };

/// Where a signal's bits lie, as bytes from the most significant one on.
struct BitField {
  std::uint8_t first_byte = 0;  ///< the one with the most significant bits
  std::int8_t step = 1;         ///< to the next less significant byte: 1 or -1
  std::uint8_t bytes = 0;       ///< that it touches, 1 to 9
  std::uint8_t shift = 0;       ///< bits of the last byte below the signal, 0 to 7
  std::uint8_t bits = 0;        ///< 1 to 64

  friend bool operator==(const BitField&, const BitField&) = default;
};

/// The field that DBC's start bit (bit i is bit i % 8 of byte i / 8, 0 the least significant) and
/// length mean. None where it is not inside `message_bytes`, or 0 or more than 64 bits long. Pure.
[[nodiscard]] std::optional<BitField> bit_field(std::size_t start_bit, std::size_t bits,
                                                ByteOrder order,
                                                std::size_t message_bytes) noexcept;

/// The bits as an unsigned number. `payload` must hold the field.
[[nodiscard]] std::uint64_t read_bits(const BitField& field,
                                      std::span<const std::byte> payload) noexcept;
/// Writes the low bits of `value` and leaves all others. `payload` must hold the field.
void write_bits(const BitField& field, std::uint64_t value, std::span<std::byte> payload) noexcept;

/// One value in a frame: physical = raw * factor + offset.
struct Signal {
  std::string name{};
  BitField field{};
  ValueType type = ValueType::kUnsigned;
  double factor = 1;
  double offset = 0;
  double minimum = 0;  ///< both 0: no range is given
  double maximum = 0;
  std::string unit{};
  bool multiplexor = false;                       ///< its value says which others are there (`M`)
  std::optional<std::uint64_t> multiplexed_by{};  ///< there only at this value of it (`mN`)
  std::size_t line = 0;                           ///< where it stands in the file, from 1

  /// The raw bits, whatever the type. `payload` must hold the field.
  [[nodiscard]] std::uint64_t raw(std::span<const std::byte> payload) const noexcept {
    return read_bits(field, payload);
  }
  /// The physical value; not finite where a float in the frame is not.
  [[nodiscard]] double decode(std::span<const std::byte> payload) const noexcept;
  /// Writes a physical value, rounded to the nearest step and kept within what the bits can hold.
  void encode(double value, std::span<std::byte> payload) const noexcept;
  /// Whether a physical value is a number within the given range.
  [[nodiscard]] bool is_plausible(double value) const noexcept;
};

}  // namespace geoflow::drivers::can::dbc
