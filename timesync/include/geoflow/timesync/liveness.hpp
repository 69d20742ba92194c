#pragma once

#include <cstdint>
#include <optional>

#include "geoflow/hal/time.hpp"

namespace geoflow::timesync {

/// Whether a stream is worth waiting for: heard within some time. Thread-bound, O(1).
class Liveness {
 public:
  /// `expected`: waited for from the beginning, before anything was heard of it.
  Liveness(bool expected, Duration silent_after) noexcept
      : waiting_{expected}, silent_after_{silent_after} {}

  /// A sample arrived, usable or not.
  void heard(HostTime t_arrival) noexcept;

  /// Whether to wait for the stream at `now`. `listening_since`: since when it is expected to be
  /// heard, if it is at all; silence does not begin before that. Counts one silence when it stops
  /// being so.
  [[nodiscard]] bool is_alive(HostTime now, HostTime listening_since,
                              std::uint64_t& silences) noexcept;

 private:
  bool waiting_;
  Duration silent_after_;
  std::optional<HostTime> last_;
};

}  // namespace geoflow::timesync
