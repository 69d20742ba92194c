#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "geoflow/hal/time.hpp"

#include "service/status_line.hpp"

namespace geoflow::daemon::service {

/// Logs what changes of the pose's status (field GEOFLOW_STATUS) and of each source's state
/// (GEOFLOW_SENSOR, GEOFLOW_STATE). Thread-compatible; reads no clock.
class ChangeLog {
 public:
  /// To be called about once a second: what has changed back meanwhile is not told.
  void note(const Observation& seen, HostTime now);

 private:
  void note_status(std::uint8_t status, HostTime now);
  void note_source(const WatchedSource& source);

  std::optional<std::uint8_t> status_;
  HostTime since_;
  std::map<std::string, std::string> states_;  // by the source's name
};

}  // namespace geoflow::daemon::service
