#include "geoflow/timesync/block_minima.hpp"

#include <cstdint>

namespace geoflow::timesync {

bool BlockMinima::add(const StampPair& pair, double residual_ns, std::int64_t block_ns) noexcept {
  if (open_ && pair.device_ns - start_ns_ < block_ns) {
    if (residual_ns < lowest_residual_ns_) {
      lowest_ = pair;
      lowest_residual_ns_ = residual_ns;
    }
    return false;
  }
  const bool closes = open_;
  // Samples that came out of order could put two minima on one device time: the envelope needs them
  // increasing.
  if (closes && (closed_ == 0 || lowest_.device_ns > (*this)[size() - 1].device_ns)) {
    pairs_[closed_ % kBlocks] = lowest_;
    ++closed_;
  }
  open_ = true;
  start_ns_ = pair.device_ns;
  lowest_ = pair;
  lowest_residual_ns_ = residual_ns;
  return closes;
}

}  // namespace geoflow::timesync
