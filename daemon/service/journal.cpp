#include "service/journal.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "geoflow/hal/log.hpp"

// Not the place of this call, which is the same for all lines.
#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

namespace geoflow::daemon::service {
namespace {

/// Whether the journal has taken the line.
bool send(const log::Line& line) {
  std::vector<std::string> fields = {fmt::format("MESSAGE={}: {}", line.category, line.message),
                                     fmt::format("PRIORITY={}", log::syslog_priority(line.level)),
                                     "SYSLOG_IDENTIFIER=geoflowd",
                                     fmt::format("GEOFLOW_CATEGORY={}", line.category)};
  for (const auto& [name, value] : line.fields) {
    fields.push_back(fmt::format("{}={}", name, value));
  }
  std::vector<iovec> parts(fields.size());
  std::ranges::transform(fields, parts.begin(), [](std::string& field) {
    return iovec{.iov_base = field.data(), .iov_len = field.size()};
  });
  return ::sd_journal_sendv(parts.data(), static_cast<int>(parts.size())) == 0;
}

}  // namespace

void log_to_journal() {
  if (log::stderr_is_journal()) {
    log::set_sink([](const log::Line& line) {
      if (!send(line)) {
        log::write_to_stderr(line);
      }
    });
  }
}

}  // namespace geoflow::daemon::service
