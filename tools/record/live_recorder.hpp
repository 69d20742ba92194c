#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "geoflow/daemon/sources.hpp"
#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/result.hpp"

#include "record/sample_queue.hpp"

namespace geoflow::tools {

/// What happened to the samples of live sources so far.
struct LiveCounts {
  std::array<std::uint64_t, drivers::kStreamCount> written{};  ///< by drivers::StreamId
  std::uint64_t dropped = 0;                                   ///< the disk was too slow for them

  [[nodiscard]] std::uint64_t total() const noexcept;
};

/// Whether to go on; asked with each sample, and at least each tenth of a second, on the thread
/// that called record_live().
using GoOn = std::function<bool(const LiveCounts&)>;

/// Starts all ports of `sources` and writes what they deliver, in the order in which it came, until
/// `go_on` is false or the camera ends by itself; what is in the queue by then is written too. An
/// error is the writer's first failure (a full disk), or a port that cannot be started. Closing the
/// bag is the caller's.
[[nodiscard]] Result<LiveCounts> record_live(daemon::Sources& sources, drivers::BagWriter& writer,
                                             const QueueLimits& limits, const GoOn& go_on);

}  // namespace geoflow::tools
