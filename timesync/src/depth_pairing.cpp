#include "geoflow/timesync/depth_pairing.hpp"

#include <chrono>
#include <cstddef>
#include <optional>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/stream_buffer.hpp"

namespace geoflow::timesync {

DepthChoice choose_depth(const StreamBuffer<DepthFrame>& depths, HostTime t, Duration tolerance,
                         std::optional<HostTime> next_color, bool share) {
  DepthChoice best;
  Duration best_distance{};
  for (std::size_t i = depths.upper_bound(t - tolerance - Duration{1}); i < depths.size(); ++i) {
    const auto& entry = depths[i];
    if (entry.timed.t - t > tolerance) {
      break;
    }
    const Duration distance = std::chrono::abs(entry.timed.t - t);
    const bool is_next_ones =
        next_color && std::chrono::abs(entry.timed.t - *next_color) < distance;
    const bool own = !entry.claimed && !is_next_ones;
    const bool better = !best.index || (own != best.own ? own : distance < best_distance);
    if ((own || share) && better) {
      best = {.index = i, .own = own};
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace geoflow::timesync
