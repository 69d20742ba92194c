#include "geoflow/timesync/liveness.hpp"

#include <algorithm>
#include <cstdint>

#include "geoflow/hal/time.hpp"

namespace geoflow::timesync {

void Liveness::heard(HostTime t_arrival) noexcept {
  last_ = last_ ? std::max(*last_, t_arrival) : t_arrival;
  waiting_ = true;
}

bool Liveness::is_alive(HostTime now, HostTime listening_since, std::uint64_t& silences) noexcept {
  const HostTime silent_since = std::max(last_.value_or(listening_since), listening_since);
  if (waiting_ && now - silent_since > silent_after_) {
    waiting_ = false;
    ++silences;
  }
  return waiting_;
}

}  // namespace geoflow::timesync
