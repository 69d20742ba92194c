#pragma once

#include <cstdint>

namespace geoflow::timesync {

/// Tells a device clock that jumped from samples that merely came late or early: a jump's residuals
/// agree.
///
/// Counts consecutive outliers on one side of the line. One that lies lower than the run's lowest
/// by more than the gate starts the run anew: so a burst after stalled delivery, whose residuals
/// fall from sample to sample, never confirms, while delays of any distribution on top of a jump
/// do, as soon as some are small. Thread-bound, O(1).
class JumpDetector {
 public:
  /// A sample of device count `device_ns`, `residual_ns` off the line. True when the run has
  /// `min_count` samples over at least `min_span_ns` of device time: the clock jumped by
  /// lowest_ns().
  [[nodiscard]] bool add(std::int64_t device_ns, double residual_ns, double gate_ns, int min_count,
                         std::int64_t min_span_ns) noexcept;
  /// A sample lay on the line.
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] double lowest_ns() const noexcept { return lowest_ns_; }

 private:
  int count_ = 0;
  std::int64_t first_device_ns_ = 0;
  double lowest_ns_ = 0;
};

}  // namespace geoflow::timesync
