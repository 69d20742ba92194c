#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

namespace geoflow::tools {

/// A replay that is over, or was interrupted: all that its outputs are made from. Times are the
/// recording's own.
struct ReplayResult {
  daemon::Run run;
  Trajectory live_base;  ///< T_map_base of each frame as the socket would have said it at its time
  std::vector<PoseEstimate> estimates;  ///< of each frame that has a pose, likewise
  Trajectory imu_base;                  ///< the same at each IMU sample, if asked for
  Trajectory final_base;                ///< after all optimisation
  Duration elapsed{};                   ///< from the opened recording to the last estimate
  Duration first_pose{};                ///< from the beginning of the opening to the first estimate
  bool interrupted = false;
};

/// Told after each frame how many there were, of how many in the recording; returning false
/// interrupts.
using ReplayProgress = std::function<bool(std::uint64_t frames, std::uint64_t total)>;

/// Replays the configured recording in lock step, with the configured map; one that is refused is
/// an error. `propagate`: with poses at IMU samples. Thread-bound.
[[nodiscard]] Result<ReplayResult> replay(const daemon::Config& config,
                                          const ReplayProgress& progress, bool propagate = false);

/// The same poses of the camera: each times T_base_cam (nothing to do where the base is the
/// camera).
[[nodiscard]] Trajectory camera_trajectory(const Trajectory& base, const Calibration& calibration);

}  // namespace geoflow::tools
