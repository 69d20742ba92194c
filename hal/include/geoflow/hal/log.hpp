#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

/// The log: one sink for the process, category and level on each line, nothing per frame above
/// debug.
namespace geoflow::log {

enum class Level { kError, kWarning, kInfo, kDebug };

/// A fact of a line beside its words, for programs that search logs.
struct Field {
  std::string_view name;  ///< in capitals: GEOFLOW_SENSOR
  std::string_view value;
};

struct Line {
  Level level = Level::kInfo;
  std::string_view category;
  std::string_view message;
  std::span<const Field> fields{};
};

/// Receives every line that passes the level. Called under a lock, one line at a time.
using Sink = std::function<void(const Line&)>;

/// Replaces the sink; an empty one restores the default, write_to_stderr(). Thread-safe.
void set_sink(Sink sink);

/// Writes `<n>category: message` where stderr is the journal (n: a syslog priority) and `level
/// category: message` elsewhere; fields are left out. For sinks.
void write_to_stderr(const Line& line);
/// Whether stderr is the journal's stream. Thread-safe.
[[nodiscard]] bool stderr_is_journal();
/// Its number in syslog(3).
[[nodiscard]] int syslog_priority(Level level) noexcept;

/// Lines above this level are dropped before they are formatted. Default kInfo. Thread-safe.
void set_level(Level level) noexcept;
[[nodiscard]] bool enabled(Level level) noexcept;

/// Hands one formatted line to the sink, whatever its level. Thread-safe; may block on stderr, so
/// not for the tracking path.
void write(const Line& line);

template <typename... Args>
void format_and_write(Level level, std::string_view category, fmt::format_string<Args...> format,
                      Args&&... args) {
  const std::string message = fmt::format(format, std::forward<Args>(args)...);
  write({.level = level, .category = category, .message = message});
}

template <typename... Args>
void error(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  format_and_write(Level::kError, category, format, std::forward<Args>(args)...);
}

template <typename... Args>
void warning(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kWarning)) {
    format_and_write(Level::kWarning, category, format, std::forward<Args>(args)...);
  }
}

template <typename... Args>
void info(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kInfo)) {
    format_and_write(Level::kInfo, category, format, std::forward<Args>(args)...);
  }
}

template <typename... Args>
void debug(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kDebug)) {
    format_and_write(Level::kDebug, category, format, std::forward<Args>(args)...);
  }
}

}  // namespace geoflow::log
