#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/time.hpp"

#include "service/source_watch.hpp"

namespace geoflow::daemon::service {

/// What the status line is made from.
struct Observation {
  std::optional<geoflow_pose> pose{};    ///< the newest of a frame
  std::uint64_t frames = 0;              ///< with an estimate, so far
  std::vector<WatchedSource> sources{};  ///< of samples
  std::string trouble{};                 ///< why there is no source yet: a sentence
};

/// The daemon's state in words, for `systemctl status`:
///
///     TRACKING 30 Hz, quality 87, 4 min; camera ok, IMU ok, legs silent 2 s (no interface can0)
///     STARTING; no D435i is connected
///
/// The rate is that of the last few seconds; the time is since the status became this one; a source
/// is silent as SourceWatch finds it, degraded when it says so itself.
/// Thread-compatible; reads no clock.
class StatusLine {
 public:
  /// To be called about once a second.
  [[nodiscard]] std::string update(const Observation& seen, HostTime now);

 private:
  struct Frames {
    std::uint64_t count = 0;
    HostTime t;
  };
  [[nodiscard]] std::string describe_pose(const Observation& seen, HostTime now);
  [[nodiscard]] double rate_hz(std::uint64_t frames, HostTime now);

  std::optional<std::uint8_t> status_;
  HostTime since_;
  std::vector<Frames> frames_;  // oldest first
};

}  // namespace geoflow::daemon::service
