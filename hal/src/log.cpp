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
bool is_journal_stream() {
  const char* named =
      std::getenv("JOURNAL_STREAM");  // NOLINT(concurrency-mt-unsafe): never set here
  struct stat status{};
  return named != nullptr && ::fstat(STDERR_FILENO, &status) == 0 &&
         fmt::format("{}:{}", status.st_dev, status.st_ino) == named;
}

}  // namespace

bool stderr_is_journal() {
  static const bool journal = is_journal_stream();
  return journal;
}

int syslog_priority(Level level) noexcept {
  constexpr std::array<int, 4> kPriority = {3, 4, 6, 7};
  return kPriority.at(static_cast<std::size_t>(level));
}

void write_to_stderr(const Line& line) {
  constexpr std::array<std::string_view, 4> kName = {"error", "warning", "info", "debug"};
  const std::string text =
      stderr_is_journal()
          ? fmt::format("<{}>{}: {}\n", syslog_priority(line.level), line.category, line.message)
          : fmt::format("{} {}: {}\n", kName.at(static_cast<std::size_t>(line.level)),
                        line.category, line.message);
  std::fwrite(text.data(), 1, text.size(), stderr);
}

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

void write(const Line& line) {
  const std::lock_guard lock{sink_mutex()};
  if (custom_sink()) {
    custom_sink()(line);
  } else {
    write_to_stderr(line);
  }
}

}  // namespace geoflow::log
