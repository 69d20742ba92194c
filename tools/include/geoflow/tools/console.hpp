#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

namespace geoflow::tools {

/// What a verb says: text for people or, under `--json`, JSON objects for programs, both on
/// standard output; progress on standard error and only when that is a terminal. Thread-bound.
class Console {
 public:
  explicit Console(bool json);

  /// True when the user asked for JSON.
  [[nodiscard]] bool json() const noexcept { return json_; }

  /// One line for people; nothing under `--json`.
  template <typename... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) {
    if (!json_) {
      write_line(fmt::format(format, std::forward<Args>(args)...));
    }
  }
  /// A result as JSON on one line (so a stream of them is NDJSON); nothing without `--json`.
  void object(const nlohmann::json& value) const;

  /// Draws or redraws the progress bar: `done` of `total` (0 where it is not known), then a short
  /// note such as a rate. Redraws only when the percentage or, without a total, ten more are done.
  void progress(std::size_t done, std::size_t total, std::string_view note);
  /// Ends the bar's line, if one is drawn.
  void end_progress();

 private:
  static void write_line(std::string_view text);

  bool json_;
  bool terminal_;
  bool drawn_ = false;
  std::size_t last_mark_ = static_cast<std::size_t>(-1);
};

}  // namespace geoflow::tools
