#include "geoflow/timesync/jump_detector.hpp"

#include <algorithm>
#include <cstdint>

namespace geoflow::timesync {

bool JumpDetector::add(std::int64_t device_ns, double residual_ns, double gate_ns, int min_count,
                       std::int64_t min_span_ns) noexcept {
  const bool other_side = (residual_ns < 0.0) != (lowest_ns_ < 0.0);
  if (count_ == 0 || other_side || residual_ns < lowest_ns_ - gate_ns) {
    count_ = 1;
    first_device_ns_ = device_ns;
    lowest_ns_ = residual_ns;
    return false;
  }
  ++count_;
  lowest_ns_ = std::min(lowest_ns_, residual_ns);
  return count_ >= min_count && device_ns - first_device_ns_ >= min_span_ns;
}

}  // namespace geoflow::timesync
