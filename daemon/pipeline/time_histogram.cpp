#include "geoflow/daemon/time_histogram.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {
namespace {

constexpr auto kRelaxed = std::memory_order_relaxed;

double to_milliseconds(double ns) {
  constexpr double kNanosecondsPerMillisecond = 1e6;
  return ns / kNanosecondsPerMillisecond;
}

/// Adds with one writer: a plain load and store, no locked instruction.
template <typename T>
void add_relaxed(std::atomic<T>& counter, T amount) {
  counter.store(counter.load(kRelaxed) + amount, kRelaxed);
}

}  // namespace

std::size_t TimeHistogram::bucket_of(std::uint64_t microseconds) noexcept {
  if (microseconds < kSubBuckets) {
    return static_cast<std::size_t>(microseconds);
  }
  // The five bits after the leading one choose the bucket within the octave.
  const auto octave =
      static_cast<std::size_t>(std::bit_width(microseconds) - std::bit_width(kSubBuckets));
  const std::size_t within = static_cast<std::size_t>(microseconds >> octave) - kSubBuckets;
  return std::min((octave + 1) * kSubBuckets + within, kBuckets - 1);
}

double TimeHistogram::upper_edge_ms(std::size_t bucket) noexcept {
  constexpr double kMillisecondsPerMicrosecond = 1e-3;
  if (bucket < kSubBuckets) {
    return static_cast<double>(bucket + 1) * kMillisecondsPerMicrosecond;
  }
  const std::size_t octave = bucket / kSubBuckets - 1;
  const auto edge = static_cast<double>(kSubBuckets + bucket % kSubBuckets + 1);
  return std::ldexp(edge, static_cast<int>(octave)) * kMillisecondsPerMicrosecond;
}

void TimeHistogram::add(Duration duration) noexcept {
  const std::int64_t ns = std::max<std::int64_t>(duration.count(), 0);
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(Duration{ns}).count();
  add_relaxed(buckets_[bucket_of(static_cast<std::uint64_t>(us))], std::uint32_t{1});
  add_relaxed(sum_ns_, ns);
  max_ns_.store(std::max(max_ns_.load(kRelaxed), ns), kRelaxed);
  add_relaxed(count_, std::uint64_t{1});
}

double TimeHistogram::percentile_ms(double share, std::uint64_t count) const noexcept {
  const double wanted = share * static_cast<double>(count);
  double seen = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    seen += static_cast<double>(buckets_[i].load(kRelaxed));
    if (seen >= wanted) {
      return std::min(upper_edge_ms(i),
                      to_milliseconds(static_cast<double>(max_ns_.load(kRelaxed))));
    }
  }
  return to_milliseconds(static_cast<double>(max_ns_.load(kRelaxed)));
}

std::vector<TimeBucket> TimeHistogram::buckets() const {
  std::vector<TimeBucket> filled;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    if (const std::uint32_t count = buckets_[i].load(kRelaxed); count > 0) {
      filled.push_back({.lower_ms = i > 0 ? upper_edge_ms(i - 1) : 0.0,
                        .upper_ms = upper_edge_ms(i),
                        .count = count});
    }
  }
  return filled;
}

TimeSummary TimeHistogram::summary() const noexcept {
  constexpr double kMedian = 0.5;
  constexpr double kHigh = 0.99;
  const std::uint64_t count = count_.load(kRelaxed);
  if (count == 0) {
    return {};
  }
  return {.count = count,
          .mean_ms = to_milliseconds(static_cast<double>(sum_ns_.load(kRelaxed)) /
                                     static_cast<double>(count)),
          .p50_ms = percentile_ms(kMedian, count),
          .p99_ms = percentile_ms(kHigh, count),
          .max_ms = to_milliseconds(static_cast<double>(max_ns_.load(kRelaxed)))};
}

}  // namespace geoflow::daemon
