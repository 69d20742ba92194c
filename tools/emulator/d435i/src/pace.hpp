#pragma once

#include <algorithm>
#include <optional>

#include "geoflow/hal/time.hpp"

namespace geoflow::emulator {

/// Whether a sample at `t` is one of those that a stream of period `interval` takes from a finer
/// one, and if so, plans its next. `due` is when the stream wants its next sample; none before its
/// first. Samples may come a little early, so that a stream at the source's own rate takes each.
[[nodiscard]] inline bool is_due(std::optional<Duration>& due, Duration t, Duration interval) {
  // At most half the time between two samples of a source: of 30 frames or 400 IMU samples a second
  // or less.
  constexpr Duration kMostEarly{16'000'000};
  constexpr int kPartEarly = 4;
  const Duration early = std::min(interval / kPartEarly, kMostEarly);
  if (due && t < *due - early) {
    return false;
  }
  due = std::max(due.value_or(t) + interval, t + interval / 2);
  return true;
}

}  // namespace geoflow::emulator
