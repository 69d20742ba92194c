#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_model.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/liveness.hpp"
#include "geoflow/timesync/stream_buffer.hpp"
#include "geoflow/timesync/wrap.hpp"

namespace geoflow::timesync {

/// One stream's way through the Synchroniser: placed by its clock, kept in its device's order,
/// buffered. Thread-bound.
template <typename Sample>
class StreamLane {
 public:
  StreamLane(std::size_t capacity, Duration max_step, const Liveness& liveness)
      : buffer{capacity, max_step}, liveness_{liveness} {}

  /// Takes an arrival; `shift` is subtracted from its host time. Where it was placed, if it was
  /// taken.
  template <typename Clock>
  std::optional<Timed<Sample>> push(const Arrival<Clock, Sample>& arrival, ClockModel<Clock>& clock,
                                    Duration shift, StreamCounters& counters) {
    if (!is_plausible_stamp_ns(arrival.t_arrival.time_since_epoch().count())) {
      ++counters.pushed;
      ++counters.invalid;
      return std::nullopt;
    }
    liveness_.heard(arrival.t_arrival);
    const auto placed = clock.add(arrival.t_device, arrival.t_arrival);
    HostStamp stamp = clock.is_identity() ? placed.stamp : order_.keep(placed);
    if (is_plausible_stamp_ns(stamp.t.time_since_epoch().count())) {
      stamp.t -= shift;
    }
    const Timed<Sample> timed{stamp.t, stamp.error_bound, arrival.sample};
    const bool taken = buffer.push(timed, arrival.t_arrival, counters);
    return taken ? std::optional{timed} : std::nullopt;
  }

  /// Whether it has been heard of late; counts a silence when it stops being so.
  [[nodiscard]] bool is_alive(HostTime now, HostTime listening_since, StreamCounters& counters) {
    return liveness_.is_alive(now, listening_since, counters.silences);
  }

  /// Whether nothing at or before `t` need be waited for: a sample at or after it came, or the
  /// stream is silent.
  [[nodiscard]] bool is_ready(HostTime t, HostTime now, HostTime listening_since,
                              StreamCounters& counters) {
    const bool alive = is_alive(now, listening_since, counters);
    const std::optional<HostTime> newest = buffer.newest();
    return !alive || (newest && *newest >= t);
  }

  /// The samples in (after, until] with the nearest one at or before and the nearest one at or
  /// after, in order; from the beginning if there is no `after`. Gives up what no later window
  /// needs.
  [[nodiscard]] std::vector<Timed<Sample>> take_window(std::optional<HostTime> after,
                                                       HostTime until, StreamCounters& counters) {
    const std::size_t beyond = buffer.upper_bound(until);
    const bool ends_on_sample = beyond > 0 && buffer[beyond - 1].timed.t == until;
    const std::size_t end = ends_on_sample ? beyond : std::min(beyond + 1, buffer.size());
    const std::size_t first_inside = after ? buffer.upper_bound(*after) : 0;
    const std::size_t begin = first_inside > 0 ? first_inside - 1 : 0;
    std::vector<Timed<Sample>> window;
    window.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      auto& entry = buffer[i];
      counters.used += entry.used ? 0U : 1U;
      entry.used = true;
      window.push_back(entry.timed);
    }
    buffer.drop(beyond > 0 ? beyond - 1 : 0, counters);
    buffer.set_horizon(until);
    return window;
  }

  StreamBuffer<Sample> buffer;

 private:
  StreamOrder order_;
  Liveness liveness_;
};

}  // namespace geoflow::timesync
