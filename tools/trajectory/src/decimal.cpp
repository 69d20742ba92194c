#include <charconv>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

constexpr int kDecimalBase = 10;
constexpr int kNanosecondDigits = 9;
/// More digits than 292 years in nanoseconds have, with room for leading zeros; longer numbers are
/// refused.
constexpr std::size_t kMaxDigits = 64;

/// digits * 10^exponent, digits without a point.
struct Decimal {
  bool negative = false;
  std::string digits;
  int exponent = 0;
};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Moves leading digits from `text` to `digits`; their number.
std::size_t take_digits(std::string_view& text, std::string& digits) {
  std::size_t count = 0;
  while (count < text.size() && is_digit(text[count])) {
    ++count;
  }
  digits.append(text.substr(0, count));
  text.remove_prefix(count);
  return count;
}

/// Reads what follows an 'e'; none if that is not an integer.
std::optional<int> parse_exponent(std::string_view text) {
  if (text.starts_with('+')) {
    text.remove_prefix(1);
  }
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  const int limit = static_cast<int>(kMaxDigits);
  if (status != std::errc{} || end != text.data() + text.size() || value > limit ||
      value < -limit) {
    return std::nullopt;
  }
  return value;
}

std::optional<Decimal> parse_decimal(std::string_view text) {
  if (text.size() > kMaxDigits) {
    return std::nullopt;
  }
  Decimal number;
  if (text.starts_with('-') || text.starts_with('+')) {
    number.negative = text.front() == '-';
    text.remove_prefix(1);
  }
  take_digits(text, number.digits);
  if (text.starts_with('.')) {
    text.remove_prefix(1);
    number.exponent = -static_cast<int>(take_digits(text, number.digits));
  }
  if (number.digits.empty()) {
    return std::nullopt;
  }
  if (text.starts_with('e') || text.starts_with('E')) {
    const auto exponent = parse_exponent(text.substr(1));
    if (!exponent) {
      return std::nullopt;
    }
    number.exponent += *exponent;
    text = {};
  }
  if (!text.empty()) {
    return std::nullopt;
  }
  return number;
}

/// Appends one digit to a count of nanoseconds; none on overflow.
std::optional<std::int64_t> append_digit(std::int64_t value, char digit) {
  constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();
  const std::int64_t added = digit - '0';
  if (value > (kMax - added) / kDecimalBase) {
    return std::nullopt;
  }
  return value * kDecimalBase + added;
}

}  // namespace

std::optional<Duration> parse_decimal_seconds(std::string_view text) {
  const auto number = parse_decimal(text);
  if (!number) {
    return std::nullopt;
  }
  // The number of digits that count whole nanoseconds; the next one rounds.
  const int whole = static_cast<int>(number->digits.size()) + number->exponent + kNanosecondDigits;
  std::int64_t ns = 0;
  for (int i = 0; i < whole; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const auto longer =
        append_digit(ns, index < number->digits.size() ? number->digits[index] : '0');
    if (!longer) {
      return std::nullopt;
    }
    ns = *longer;
  }
  const auto next = static_cast<std::size_t>(whole);
  if (whole >= 0 && next < number->digits.size() && number->digits[next] >= '5' &&
      ns < std::numeric_limits<std::int64_t>::max()) {
    ++ns;
  }
  return Duration{number->negative ? -ns : ns};
}

}  // namespace geoflow::tools
