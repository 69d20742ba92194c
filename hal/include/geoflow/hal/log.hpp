#pragma once

#include <functional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

/// The log: one sink for the process, category and level on each line, nothing per frame above
/// debug.
namespace geoflow::log {

enum class Level { kError, kWarning, kInfo, kDebug };

/// Receives every line that passes the level. Called under a lock, one line at a time.
using Sink = std::function<void(Level, std::string_view category, std::string_view message)>;

/// Replaces the sink; an empty one restores the default, which writes `<n>category: message` lines
/// to stderr where that is the journal (n: a syslog priority) and `level category: message`
/// elsewhere. Thread-safe.
void set_sink(Sink sink);

/// Lines above this level are dropped before they are formatted. Default kInfo. Thread-safe.
void set_level(Level level) noexcept;
[[nodiscard]] bool enabled(Level level) noexcept;

/// Hands one formatted line to the sink. Thread-safe; may block on stderr, so not for the tracking
/// path.
void write(Level level, std::string_view category, std::string_view message);

template <typename... Args>
void error(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kError, category, fmt::format(format, std::forward<Args>(args)...));
}

template <typename... Args>
void warning(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kWarning)) {
    write(Level::kWarning, category, fmt::format(format, std::forward<Args>(args)...));
  }
}

template <typename... Args>
void info(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kInfo)) {
    write(Level::kInfo, category, fmt::format(format, std::forward<Args>(args)...));
  }
}

template <typename... Args>
void debug(std::string_view category, fmt::format_string<Args...> format, Args&&... args) {
  if (enabled(Level::kDebug)) {
    write(Level::kDebug, category, fmt::format(format, std::forward<Args>(args)...));
  }
}

}  // namespace geoflow::log
