#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/drivers/d435i.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/propagator.hpp"
#include "geoflow/timesync/counters.hpp"

namespace geoflow::daemon {

/// Gets every estimate with its packet, on the thread that estimates. Must not block.
using EstimateHandler = std::function<void(const SyncedPacket&, const PoseEstimate&)>;

/// Where a run's samples come from.
struct Ports {
  DepthCamera& camera;
  Imu* imu = nullptr;    ///< null: there is none
  Legs* legs = nullptr;  ///< likewise
};

/// Gets every propagated pose, on the thread that synchronises. Must not block.
using PropagatedHandler = std::function<void(const PropagatedPose&)>;

/// One source with one estimator and what is measured of them: what LockStepRunner and Pipeline
/// work on.
struct Run {
  std::unique_ptr<drivers::RecordedStreams> streams;  ///< null: a camera is the source
  std::unique_ptr<drivers::D435i> camera{};  ///< with its IMU, in the place of a recording; or null
  Calibration calibration{};     ///< the source's, changed where a device stands in for a sensor
  std::shared_ptr<Legs> legs{};  ///< a device's, in the place of the source's; null: none
  std::shared_ptr<Imu> imu{};    ///< likewise
  std::unique_ptr<RunStatistics> statistics;
  std::unique_ptr<slam::Core> core;
  std::unique_ptr<slam::Propagator> propagator;  ///< null: no IMU whose place is known
  /// Why the configured map was not taken; none where it was, or none is configured.
  std::optional<Error> map_refused{};
  timesync::SynchroniserCounters synchroniser;  ///< filled when the run is over

  /// The recording's ports, but for those that a device stands in for.
  [[nodiscard]] Ports ports();
  /// Delivers at the source's pace, until a recording ends or it is stopped.
  [[nodiscard]] Result<void> play(const std::stop_token& stop) const;
  /// What the thread in play() shows of itself; any thread.
  [[nodiscard]] ThreadActivity activity() const;
  /// A time on the recording's own time line; of a device the same.
  [[nodiscard]] HostTime to_recording_time(HostTime t) const;
};

/// What can be known to be wrong with the configured source without any device: names, what does
/// not go together, a calibration folder that a camera's is to be completed from. Errors name key
/// or file; kInvalidArgument, or as of load_calibration().
[[nodiscard]] Result<void> check_source(const Config& config);

/// Opens the configured source and makes an estimator for its calibration, which begins with the
/// configured map if that can be read and was made with this calibration; from then on the process
/// keeps the memory it frees. Errors are those of check_source(), and of what cannot be opened;
/// they name file, line or key.
[[nodiscard]] Result<Run> open_run(const Config& config);

}  // namespace geoflow::daemon
