#include "arrivals.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"

namespace geoflow::simulator {

void plan_arrivals(const PlannedStream& stream, const RandomStream& random,
                   std::vector<PlannedArrival>& arrivals) {
  HostTime last = HostTime::min();
  for (std::size_t i = 0; i < stream.measured.size(); ++i) {
    RandomStream own = random.at(i);
    const double further_s = -stream.delay.jitter_s * std::log1p(-own.uniform());
    last = std::max(last, stream.measured[i] + from_seconds(stream.delay.latency_s + further_s));
    arrivals.push_back({.t = last, .kind = stream.kind, .index = i});
  }
}

}  // namespace geoflow::simulator
