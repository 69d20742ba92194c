#include "can/candump.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::can {
namespace {

constexpr int kHexadecimal = 16;
constexpr std::size_t kStandardDigits = 3;
constexpr std::size_t kExtendedDigits = 8;
// The top bits of the kernel's can_id (linux/can.h), which candump writes as part of an identifier.
constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;
constexpr std::uint32_t kStandardMask = 0x7FF;
constexpr std::array kFdLengths = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

std::optional<std::uint32_t> parse_hex(std::string_view digits) {
  std::uint32_t value = 0;
  const auto [end, failed] =
      std::from_chars(digits.data(), digits.data() + digits.size(), value, kHexadecimal);
  return failed == std::errc{} && end == digits.data() + digits.size() ? std::optional{value}
                                                                       : std::nullopt;
}

Result<void> parse_identifier(std::string_view digits, Frame& frame) {
  const auto value = parse_hex(digits);
  const bool short_form = digits.size() == kStandardDigits;
  if (!value || (!short_form && digits.size() != kExtendedDigits)) {
    return fail(ErrorCode::kInvalidData, "'{}' is no identifier of 3 or 8 hexadecimal digits",
                digits);
  }
  if (short_form && *value > kStandardMask) {
    return fail(ErrorCode::kInvalidData, "identifier {} has more than 11 bits", digits);
  }
  frame.error = !short_form && (*value & kErrorFlag) != 0;
  frame.extended = !short_form && !frame.error;
  frame.id = *value & kExtendedMask;
  if (!short_form && *value > (kErrorFlag | kExtendedMask)) {
    return fail(ErrorCode::kInvalidData, "identifier {} has more than 29 bits", digits);
  }
  return {};
}

Result<void> parse_data(std::string_view digits, Frame& frame) {
  const std::size_t length = digits.size() / 2;
  const bool fits =
      frame.fd ? std::ranges::find(kFdLengths, static_cast<int>(length)) != kFdLengths.end()
               : length <= kClassicBytes;
  if (digits.size() % 2 != 0 || !fits) {
    return fail(ErrorCode::kInvalidData, "{} digits are no payload of a {} frame", digits.size(),
                frame.fd ? "CAN FD" : "classic");
  }
  for (std::size_t i = 0; i < length; ++i) {
    const auto value = parse_hex(digits.substr(2 * i, 2));
    if (!value) {
      return fail(ErrorCode::kInvalidData, "'{}' is no byte in hexadecimal digits",
                  digits.substr(2 * i, 2));
    }
    frame.data[i] = static_cast<std::byte>(*value);
  }
  frame.length = static_cast<std::uint8_t>(length);
  return {};
}

Result<Frame> parse_frame(std::string_view text) {
  const std::size_t hash = text.find('#');
  if (hash == std::string_view::npos) {
    return fail(ErrorCode::kInvalidData, "'{}' has no # between identifier and data", text);
  }
  Frame frame;
  if (auto identified = parse_identifier(text.substr(0, hash), frame); !identified) {
    return tl::unexpected{identified.error()};
  }
  std::string_view data = text.substr(hash + 1);
  if (data.starts_with('#')) {
    const auto flags = parse_hex(data.substr(1, 1));
    if (!flags || frame.error) {
      return fail(ErrorCode::kInvalidData, "'{}' is no CAN FD frame", text);
    }
    frame.fd = true;
    frame.fd_flags = static_cast<std::uint8_t>(*flags);
    data.remove_prefix(2);
  } else if (data.starts_with('R')) {
    frame.remote = true;
    return frame;
  }
  // `_9` and the like: a data length code above 8 of a classic frame.
  data = data.substr(0, data.find('_'));
  return parse_data(data, frame).map([&] { return frame; });
}

}  // namespace

Result<LogLine> parse_log_line(std::string_view line) {
  const auto fields = text::split_blanks(line);
  constexpr std::size_t kFields = 3;  // a fourth is the direction, R or T
  if (fields.size() < kFields || fields.size() > kFields + 1) {
    return fail(ErrorCode::kInvalidData,
                "{} fields where 3 are expected: (seconds), interface, identifier#data",
                fields.size());
  }
  std::string_view stamp = fields[0];
  std::optional<Duration> time;
  if (stamp.starts_with('(') && stamp.ends_with(')')) {
    time = text::parse_seconds(stamp.substr(1, stamp.size() - 2));
  }
  if (!time) {
    return fail(ErrorCode::kInvalidData, "'{}' is no time in seconds in parentheses", stamp);
  }
  return parse_frame(fields[2]).map([&](const Frame& frame) {
    return LogLine{.stamp = *time, .interface = fields[1], .frame = frame};
  });
}

std::string format_log_line(Duration stamp, std::string_view interface, const Frame& frame) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(stamp);
  const auto rest = std::chrono::floor<std::chrono::microseconds>(stamp - seconds);
  std::string line = fmt::format("({}.{:06}) {} ", seconds.count(), rest.count(), interface);
  const auto out = std::back_inserter(line);
  if (frame.error || frame.extended) {
    fmt::format_to(out, "{:08X}#", frame.id | (frame.error ? kErrorFlag : 0U));
  } else {
    fmt::format_to(out, "{:03X}#", frame.id);
  }
  if (frame.remote) {
    line += 'R';
    return line;
  }
  if (frame.fd) {
    fmt::format_to(out, "#{:X}", frame.fd_flags);
  }
  for (const std::byte byte : frame.payload()) {
    fmt::format_to(out, "{:02X}", std::to_integer<unsigned>(byte));
  }
  return line;
}

}  // namespace geoflow::drivers::can
