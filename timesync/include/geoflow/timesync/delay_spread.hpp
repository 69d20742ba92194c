#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace geoflow::timesync {

/// Running median of the last 64 delays above a clock's line. Thread-bound; no allocation; the
/// median is taken anew at every doubling of the count, later every 32 values: amortised O(1).
class DelaySpread {
 public:
  void add(double delay_ns) noexcept;
  void reset() noexcept { count_ = 0; }
  /// J [ns]; kept over reset() until values come in again.
  [[nodiscard]] double median_ns() const noexcept { return median_ns_; }

 private:
  static constexpr std::size_t kKept = 64;
  static constexpr std::size_t kRefresh = 32;

  std::array<double, kKept> delays_ns_{};
  std::size_t count_ = 0;
  double median_ns_ = 0;
};

}  // namespace geoflow::timesync
