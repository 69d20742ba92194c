#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/sources.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/propagator.hpp"
#include "geoflow/timesync/counters.hpp"

namespace geoflow::daemon {

/// Gets every estimate with its packet, on the thread that estimates. Must not block.
using EstimateHandler = std::function<void(const SyncedPacket&, const PoseEstimate&)>;

/// Called on the thread that estimates, between two frames: `run.core` is the handler's meanwhile.
/// True where it has put another one there.
using BetweenFrames = std::function<bool()>;

/// Gets every propagated pose, on the thread that synchronises. Must not block.
using PropagatedHandler = std::function<void(const PropagatedPose&)>;

/// Its sources with one estimator and what is measured of them: what LockStepRunner and Pipeline
/// work on. There is a camera port.
struct Run : Sources {
  std::unique_ptr<RunStatistics> statistics{};
  std::unique_ptr<slam::Core> core{};
  std::unique_ptr<slam::Propagator> propagator{};  ///< null: no IMU whose place is known
  /// Why the configured map was not taken; none where it was, or none is configured.
  std::optional<Error> map_refused{};
  timesync::SynchroniserCounters synchroniser{};  ///< filled when the run is over
  /// The estimator's thread: discontinuities before the present `core`, which are added to those of
  /// its estimates, and the sum in the newest one.
  std::uint32_t earlier_resets = 0;
  std::uint32_t resets = 0;
};

/// check_sources(), and whether there is a recording or a camera at all.
[[nodiscard]] Result<void> check_source(const Config& config);

/// Opens the configured source and makes an estimator for it. Errors are those of check_source(),
/// and of what cannot be opened; they name file, line or key.
[[nodiscard]] Result<Run> open_run(const Config& config);

/// Makes an estimator for the calibration of `sources`, which begins with the configured map if
/// that can be read and was made with this calibration; from then on the process keeps the memory
/// it frees. kInvalidArgument where there is no camera.
[[nodiscard]] Result<Run> make_run(const Config& config, Sources sources);

}  // namespace geoflow::daemon
