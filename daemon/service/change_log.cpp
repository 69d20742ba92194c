#include "service/change_log.hpp"

#include <array>
#include <cstdint>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

#include "service/source_watch.hpp"
#include "service/status_line.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr const char* kCategory = "status";

bool is_well(const WatchedSource& source) {
  return !source.silent && (source.health.state == SourceState::kStreaming ||
                            source.health.state == SourceState::kStopped);
}

}  // namespace

void ChangeLog::note(const Observation& seen, HostTime now) {
  if (seen.pose && status_ != seen.pose->status) {
    note_status(seen.pose->status, now);
  }
  for (const WatchedSource& source : seen.sources) {
    note_source(source);
  }
}

void ChangeLog::note_status(std::uint8_t status, HostTime now) {
  const std::string name = status_name(status);
  const std::string message = status_ ? fmt::format("{}, after {} of {}", name,
                                                    in_words(now - since_), status_name(*status_))
                                      : name;
  status_ = status;
  since_ = now;
  const std::array<log::Field, 1> fields = {{{.name = "GEOFLOW_STATUS", .value = name}}};
  log::write({.level = status == GEOFLOW_LOST ? log::Level::kWarning : log::Level::kInfo,
              .category = kCategory,
              .message = message,
              .fields = fields});
}

void ChangeLog::note_source(const WatchedSource& source) {
  const std::string state = state_name(source);
  if (std::exchange(states_[source.name], state) == state) {
    return;
  }
  const std::array<log::Field, 2> fields = {{{.name = "GEOFLOW_SENSOR", .value = source.name},
                                             {.name = "GEOFLOW_STATE", .value = state}}};
  log::write({.level = is_well(source) ? log::Level::kInfo : log::Level::kWarning,
              .category = kCategory,
              .message = describe(source),
              .fields = fields});
}

}  // namespace geoflow::daemon::service
