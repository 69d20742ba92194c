#include "replay/text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::text {
namespace {

constexpr std::string_view kBlanks = " \t";
constexpr std::size_t kNanosecondDigits = 9;
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
// 146 years; leaves room for sums of two times.
constexpr std::int64_t kMostNanoseconds = std::int64_t{1} << 62U;
constexpr std::int64_t kMostSeconds = kMostNanoseconds / kNanosecondsPerSecond;

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) {
    return {};
  }
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::optional<std::int64_t> parse_whole(std::string_view text) noexcept {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 0 ||
      text.front() == '-') {
    return std::nullopt;
  }
  return value;
}

}  // namespace

Result<std::string_view> data_of(std::string_view line) {
  if (line.size() > kLongestLine) {
    return fail(ErrorCode::kInvalidData, "a line of {} bytes, at most {} are allowed", line.size(),
                kLongestLine);
  }
  if (line.find('\0') != std::string_view::npos) {
    return fail(ErrorCode::kInvalidData, "a zero byte in a text file");
  }
  if (!line.empty() && line.back() == '\r') {
    line.remove_suffix(1);
  }
  line = trim(line);
  return line.starts_with('#') ? std::string_view{} : line;
}

Result<void> for_each_line(std::string_view name, std::string_view content,
                           const std::function<Result<void>(const Line&)>& use) {
  std::size_t number = 0;
  while (!content.empty()) {
    ++number;
    const std::size_t end = content.find('\n');
    const std::string_view line = content.substr(0, end);
    content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
    auto data = data_of(line);
    if (!data) {
      return tl::unexpected{std::move(data.error()).in(fmt::format("{}:{}", name, number))};
    }
    if (data->empty()) {
      continue;
    }
    if (auto used = use(Line{.number = number, .text = *data}); !used) {
      return used;
    }
  }
  return {};
}

Result<std::string> read_file(const std::filesystem::path& path, std::size_t limit_bytes) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return fail(ErrorCode::kNotFound, "{}: no such file", path.string());
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) {
    return fail(ErrorCode::kSystem, "{}: {}", path.string(), error.message());
  }
  if (size > limit_bytes) {
    return fail(ErrorCode::kInvalidData, "{}: {} bytes, at most {} are read", path.string(), size,
                limit_bytes);
  }
  std::ifstream file{path, std::ios::binary};
  std::string content(static_cast<std::size_t>(size), '\0');
  file.read(content.data(), static_cast<std::streamsize>(size));
  if (!file) {
    return fail(ErrorCode::kSystem, "{}: cannot be read", path.string());
  }
  return content;
}

std::vector<std::string_view> split_blanks(std::string_view text) {
  std::vector<std::string_view> fields;
  while (!(text = trim(text)).empty()) {
    const std::size_t end = text.find_first_of(kBlanks);
    fields.push_back(text.substr(0, end));
    text.remove_prefix(fields.back().size());
  }
  return fields;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t end = text.find(separator);
    fields.push_back(trim(text.substr(0, end)));
    if (end == std::string_view::npos) {
      return fields;
    }
    text.remove_prefix(end + 1);
  }
}

std::optional<double> parse_number(std::string_view text) noexcept {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<Duration> parse_seconds(std::string_view text) noexcept {
  if (text.find_first_of("eE") != std::string_view::npos) {
    const auto seconds = parse_number(text);
    const bool fits = seconds && *seconds >= 0 && *seconds < static_cast<double>(kMostSeconds);
    return fits ? std::optional<Duration>{from_seconds(*seconds)} : std::nullopt;
  }
  const std::size_t point = text.find('.');
  std::string_view fraction;
  if (point != std::string_view::npos) {
    fraction = text.substr(point + 1);
  }
  const auto seconds = parse_whole(text.substr(0, point));
  if (!seconds || *seconds >= kMostSeconds) {
    return std::nullopt;
  }
  constexpr std::int64_t kDecimal = 10;
  std::int64_t nanoseconds = 0;
  for (std::size_t i = 0; i < std::max(fraction.size(), kNanosecondDigits); ++i) {
    const char digit = i < fraction.size() ? fraction[i] : '0';
    if (digit < '0' || digit > '9') {
      return std::nullopt;
    }
    if (i < kNanosecondDigits) {
      nanoseconds = nanoseconds * kDecimal + (digit - '0');
    }
  }
  return Duration{*seconds * kNanosecondsPerSecond + nanoseconds};
}

std::optional<Duration> parse_nanoseconds(std::string_view text) noexcept {
  const auto whole = parse_whole(text);
  return whole && *whole < kMostNanoseconds ? std::optional<Duration>{Duration{*whole}}
                                            : std::nullopt;
}

}  // namespace geoflow::drivers::text
