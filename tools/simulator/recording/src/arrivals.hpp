#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"

/// When samples reach the host.
namespace geoflow::simulator {

/// A stream, in the order in which equal arrivals are delivered.
enum class SampleKind : std::uint8_t { kImu, kLegs, kOdometry, kColor, kDepth };

/// One sample to come.
struct PlannedArrival {
  HostTime t;
  SampleKind kind = SampleKind::kImu;
  std::size_t index = 0;

  friend auto operator<=>(const PlannedArrival&, const PlannedArrival&) = default;
};

/// How one stream is delayed.
struct Delay {
  double latency_s = 0;
  double jitter_s = 0;  ///< mean of an exponential distribution
};

/// A stream of samples whose measurements end at the given times, in ascending order.
struct PlannedStream {
  SampleKind kind = SampleKind::kImu;
  Delay delay{};
  std::vector<HostTime> measured{};
};

/// Adds the stream's arrivals. What a sample draws depends on `random` and its index only; none
/// arrives before its predecessor.
void plan_arrivals(const PlannedStream& stream, const RandomStream& random,
                   std::vector<PlannedArrival>& arrivals);

}  // namespace geoflow::simulator
