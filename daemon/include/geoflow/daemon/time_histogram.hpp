#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// What a histogram held at one moment.
struct TimeSummary {
  std::uint64_t count = 0;
  double mean_ms = 0;
  double p50_ms = 0;
  double p99_ms = 0;
  double max_ms = 0;
};

/// So many durations of at least `lower_ms` and less than `upper_ms`.
struct TimeBucket {
  double lower_ms = 0;
  double upper_ms = 0;
  std::uint64_t count = 0;
};

/// How long something took, over a whole run: log-linear buckets of 3 % width from 1 us to 67 s (as
/// HdrHistogram's), so percentiles are within 3 %; count, mean and maximum are exact. One thread
/// adds, any may read; no allocation, no lock.
class TimeHistogram {
 public:
  void add(Duration duration) noexcept;
  [[nodiscard]] TimeSummary summary() const noexcept;
  /// The buckets that are not empty, in ascending order; the last possible one has no upper bound.
  [[nodiscard]] std::vector<TimeBucket> buckets() const;

 private:
  static constexpr std::size_t kSubBuckets = 32;  ///< of one octave
  static constexpr std::size_t kOctaves = 27;     ///< above the linear part, which ends at 32 us
  static constexpr std::size_t kBuckets = kSubBuckets * kOctaves;

  [[nodiscard]] static std::size_t bucket_of(std::uint64_t microseconds) noexcept;
  [[nodiscard]] static double upper_edge_ms(std::size_t bucket) noexcept;
  [[nodiscard]] double percentile_ms(double share, std::uint64_t count) const noexcept;

  std::array<std::atomic<std::uint32_t>, kBuckets> buckets_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::int64_t> sum_ns_{0};
  std::atomic<std::int64_t> max_ns_{0};
};

}  // namespace geoflow::daemon
