#include "geoflow/timesync/wrap.hpp"

#include <cstdint>

namespace geoflow::timesync {

std::int64_t unwrap_ns(std::int64_t raw_ns, std::int64_t period_ns,
                       std::int64_t expected_ns) noexcept {
  std::int64_t ahead_ns = (raw_ns - expected_ns) % period_ns;  // in (-period, period)
  if (ahead_ns > period_ns / 2) {
    ahead_ns -= period_ns;
  } else if (ahead_ns < -(period_ns / 2)) {
    ahead_ns += period_ns;
  }
  return expected_ns + ahead_ns;
}

}  // namespace geoflow::timesync
