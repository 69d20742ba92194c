#include "geoflow/timesync/delay_spread.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

namespace geoflow::timesync {

void DelaySpread::add(double delay_ns) noexcept {
  delays_ns_[count_ % kKept] = delay_ns;
  ++count_;
  if (!std::has_single_bit(count_) && count_ % kRefresh != 0) {
    return;
  }
  auto scratch = delays_ns_;
  const auto size = static_cast<std::ptrdiff_t>(std::min(count_, kKept));
  auto* const middle = scratch.begin() + size / 2;
  std::nth_element(scratch.begin(), middle, scratch.begin() + size);
  median_ns_ = *middle;
}

}  // namespace geoflow::timesync
