#include "geoflow/hal/log.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

namespace geoflow::log {
namespace {

std::atomic<Level> maximum_level{Level::kInfo};

/// Serialises lines from all threads; nothing on the tracking path logs.
std::mutex& sink_mutex() {
  static std::mutex mutex;
  return mutex;
}

Sink& custom_sink() {
  static Sink sink;
  return sink;
}

/// Whether stderr still is the journal's stream that $JOURNAL_STREAM names (systemd.exec(5)): the
/// variable is inherited by what is started from there with another stderr, such as a terminal.
bool stderr_is_journal() {
  const char* named =
      std::getenv("JOURNAL_STREAM");  // NOLINT(concurrency-mt-unsafe): never set here
  struct stat status{};
  return named != nullptr && ::fstat(STDERR_FILENO, &status) == 0 &&
         fmt::format("{}:{}", status.st_dev, status.st_ino) == named;
}

void write_stderr(Level level, std::string_view category, std::string_view message) {
  constexpr std::array<int, 4> kSyslogPriority = {3, 4, 6, 7};
  constexpr std::array<std::string_view, 4> kName = {"error", "warning", "info", "debug"};
  static const bool journal = stderr_is_journal();
  const auto index = static_cast<std::size_t>(level);
  const std::string line =
      journal ? fmt::format("<{}>{}: {}\n", kSyslogPriority.at(index), category, message)
              : fmt::format("{} {}: {}\n", kName.at(index), category, message);
  std::fwrite(line.data(), 1, line.size(), stderr);
}

}  // namespace

void set_sink(Sink sink) {
  const std::lock_guard lock{sink_mutex()};
  custom_sink() = std::move(sink);
}

void set_level(Level level) noexcept {
  maximum_level = level;
}

bool enabled(Level level) noexcept {
  return level <= maximum_level.load(std::memory_order_relaxed);
}

void write(Level level, std::string_view category, std::string_view message) {
  const std::lock_guard lock{sink_mutex()};
  if (custom_sink()) {
    custom_sink()(level, category, message);
  } else {
    write_stderr(level, category, message);
  }
}

}  // namespace geoflow::log
