#include "geoflow/tools/console.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

namespace geoflow::tools {
namespace {

constexpr std::size_t kBarWidth = 32;
constexpr std::size_t kPercent = 100;
constexpr std::size_t kRedrawEvery = 10;

void write_error_stream(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace

Console::Console(bool json) : json_{json}, terminal_{::isatty(STDERR_FILENO) == 1} {}

void Console::write_line(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fputc('\n', stdout);
  std::fflush(stdout);
}

void Console::object(const nlohmann::json& value) const {
  if (json_) {
    write_line(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
}

void Console::progress(std::size_t done, std::size_t total, std::string_view note) {
  const std::size_t mark = total > 0 ? done * kPercent / total : done / kRedrawEvery;
  if (!terminal_ || (drawn_ && mark == last_mark_)) {
    return;
  }
  last_mark_ = mark;
  drawn_ = true;
  if (total == 0) {
    write_error_stream(fmt::format("\r{} {}\x1b[K", done, note));
    return;
  }
  const std::size_t filled = std::min(kBarWidth, done * kBarWidth / total);
  write_error_stream(fmt::format("\r[{}{}] {}/{} {}\x1b[K", std::string(filled, '#'),
                                 std::string(kBarWidth - filled, '.'), done, total, note));
}

void Console::end_progress() {
  if (drawn_) {
    write_error_stream("\n");
    drawn_ = false;
  }
}

}  // namespace geoflow::tools
