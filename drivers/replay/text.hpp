#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// Line-based text files of recordings: lists of images, csv tables.
namespace geoflow::drivers::text {

/// One line that carries data: no comment, not empty, no line end (LF or CR LF).
struct Line {
  std::size_t number = 0;  ///< from 1
  std::string_view text;
};

inline constexpr std::size_t kLongestLine = 4096;  ///< [B]

/// What of a line without its LF is data: no CR, no blanks around it; empty for a comment. An Error
/// (without place) if it is longer than kLongestLine or has a NUL byte.
[[nodiscard]] Result<std::string_view> data_of(std::string_view line);

/// Calls `use` for every data line of `content` until it fails. `name` stands before the line
/// number in errors. Lines that start with '#' are comments; a NUL byte or a line of over 4096
/// bytes is an error.
[[nodiscard]] Result<void> for_each_line(std::string_view name, std::string_view content,
                                         const std::function<Result<void>(const Line&)>& use);

/// The whole file, if it is a regular file of at most `limit_bytes`.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& path,
                                            std::size_t limit_bytes);

/// The fields between blanks and tabs, or between single separators with blanks trimmed.
[[nodiscard]] std::vector<std::string_view> split_blanks(std::string_view text);
[[nodiscard]] std::vector<std::string_view> split(std::string_view text, char separator);

/// A finite number that fills the whole text.
[[nodiscard]] std::optional<double> parse_number(std::string_view text) noexcept;

/// A time in decimal seconds, exact to the nanosecond (further digits are cut off; with an
/// exponent, as exact as a double), or in whole nanoseconds; not negative, below 2^62 ns.
[[nodiscard]] std::optional<Duration> parse_seconds(std::string_view text) noexcept;
[[nodiscard]] std::optional<Duration> parse_nanoseconds(std::string_view text) noexcept;

}  // namespace geoflow::drivers::text
