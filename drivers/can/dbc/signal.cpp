#include "can/dbc/signal.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

namespace geoflow::drivers::can::dbc {
namespace {

constexpr std::size_t kByteBits = 8;
constexpr std::size_t kMostBits = 64;

std::uint64_t mask_of(std::size_t bits) noexcept {
  return bits >= kMostBits ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
}

std::uint64_t byte_at(const BitField& field, std::size_t i,
                      std::span<const std::byte> payload) noexcept {
  const int at = field.first_byte + field.step * static_cast<int>(i);
  return std::to_integer<std::uint64_t>(payload[static_cast<std::size_t>(at)]);
}

/// The number whose `bits` low bits these are in two's complement.
std::int64_t sign_extended(std::uint64_t raw, std::size_t bits) noexcept {
  const std::size_t unused = kMostBits - bits;
  return static_cast<std::int64_t>(raw << unused) >> unused;
}

/// The nearest whole number of steps that the field can hold.
std::uint64_t to_raw(double steps, const BitField& field, bool has_sign) noexcept {
  const std::size_t magnitude_bits = field.bits - (has_sign ? 1U : 0U);
  const double limit = std::ldexp(1.0, static_cast<int>(magnitude_bits));
  const double lowest = has_sign ? -limit : 0.0;
  // The largest double below 2^n: casting 2^n itself would overflow.
  const double highest = std::nextafter(limit, 0.0);
  const double whole = std::clamp(std::nearbyint(steps), lowest, std::max(limit - 1, 0.0));
  const double kept = std::min(whole, highest);
  return has_sign ? static_cast<std::uint64_t>(static_cast<std::int64_t>(kept))
                  : static_cast<std::uint64_t>(kept);
}

}  // namespace

std::optional<BitField> bit_field(std::size_t start_bit, std::size_t bits, ByteOrder order,
                                  std::size_t message_bytes) noexcept {
  const std::size_t message_bits = message_bytes * kByteBits;
  if (bits == 0 || bits > kMostBits || start_bit >= message_bits) {
    return std::nullopt;
  }
  const bool intel = order == ByteOrder::kIntel;
  // Motorola counts bits from the most significant one on through the bytes in their order.
  const std::size_t begin =
      intel ? start_bit
            : start_bit / kByteBits * kByteBits + (kByteBits - 1 - start_bit % kByteBits);
  const std::size_t end = begin + bits;
  if (end > message_bits) {
    return std::nullopt;
  }
  const std::size_t low = begin / kByteBits;
  const std::size_t high = (end - 1) / kByteBits;
  return BitField{.first_byte = static_cast<std::uint8_t>(intel ? high : low),
                  .step = static_cast<std::int8_t>(intel ? -1 : 1),
                  .bytes = static_cast<std::uint8_t>(high - low + 1),
                  .shift = static_cast<std::uint8_t>(intel ? begin % kByteBits
                                                           : kByteBits - 1 - (end - 1) % kByteBits),
                  .bits = static_cast<std::uint8_t>(bits)};
}

std::uint64_t read_bits(const BitField& field, std::span<const std::byte> payload) noexcept {
  const std::size_t last = field.bytes - 1U;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < last; ++i) {
    value = value << kByteBits | byte_at(field, i, payload);
  }
  value = value << (kByteBits - field.shift) | byte_at(field, last, payload) >> field.shift;
  return value & mask_of(field.bits);
}

void write_bits(const BitField& field, std::uint64_t value, std::span<std::byte> payload) noexcept {
  std::uint64_t mask = mask_of(field.bits);
  value &= mask;
  std::size_t shift = field.shift;
  for (std::size_t i = field.bytes; i > 0; --i) {
    const int at = field.first_byte + field.step * static_cast<int>(i - 1);
    std::byte& byte = payload[static_cast<std::size_t>(at)];
    const auto keep = static_cast<std::byte>(~(mask << shift));
    byte = (byte & keep) | static_cast<std::byte>(value << shift);
    const std::size_t written = kByteBits - shift;
    value >>= written;
    mask >>= written;
    shift = 0;
  }
}

double Signal::decode(std::span<const std::byte> payload) const noexcept {
  const std::uint64_t bits = raw(payload);
  switch (type) {
    case ValueType::kUnsigned:
      return static_cast<double>(bits) * factor + offset;
    case ValueType::kSigned:
      return static_cast<double>(sign_extended(bits, field.bits)) * factor + offset;
    case ValueType::kFloat32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits))) * factor +
             offset;
    case ValueType::kFloat64:
      return std::bit_cast<double>(bits) * factor + offset;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

void Signal::encode(double value, std::span<std::byte> payload) const noexcept {
  const double steps = (value - offset) / factor;
  std::uint64_t bits = 0;
  if (type == ValueType::kFloat32) {
    bits = std::bit_cast<std::uint32_t>(static_cast<float>(steps));
  } else if (type == ValueType::kFloat64) {
    bits = std::bit_cast<std::uint64_t>(steps);
  } else if (std::isfinite(steps)) {
    bits = to_raw(steps, field, type == ValueType::kSigned);
  }
  write_bits(field, bits, payload);
}

bool Signal::is_plausible(double value) const noexcept {
  const bool has_range = minimum < maximum;
  // The ends are rounded in the file: half a step of grace.
  const double grace = std::abs(factor) * 0.5;
  return std::isfinite(value) &&
         (!has_range || (value >= minimum - grace && value <= maximum + grace));
}

}  // namespace geoflow::drivers::can::dbc
