#pragma once

#include <cstddef>
#include <optional>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/stream_buffer.hpp"

namespace geoflow::timesync {

/// Which depth frame a colour frame gets.
struct DepthChoice {
  std::optional<std::size_t> index;  ///< into the buffer; none: no depth within tolerance
  /// It is no other colour frame's: not yet claimed, and no nearer to the next colour frame.
  /// Otherwise it is lent.
  bool own = false;
};

/// The depth frame nearest to the colour frame at `t` within `tolerance`, of those that are its
/// own; where there is none and `share` is set, the nearest at all. `next_color`: the colour frame
/// after it, if known. A lent frame stays unclaimed for the colour frame that it is nearest to, so
/// that one lost depth frame does not shift all later pairs.
[[nodiscard]] DepthChoice choose_depth(const StreamBuffer<DepthFrame>& depths, HostTime t,
                                       Duration tolerance, std::optional<HostTime> next_color,
                                       bool share);

}  // namespace geoflow::timesync
