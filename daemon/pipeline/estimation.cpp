#include "pipeline/estimation.hpp"

#include <atomic>
#include <cstddef>

#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

namespace geoflow::daemon {

PoseEstimate process_packet(Run& run, const SyncedPacket& packet) {
  const HostTime begin = HostClock::now();
  PoseEstimate estimate = run.core->process(packet);
  estimate.reset_counter += run.earlier_resets;
  run.resets = estimate.reset_counter;
  run.statistics->process.add(HostClock::now() - begin);
  run.statistics->counters.by_status.at(static_cast<std::size_t>(estimate.status))
      .fetch_add(1, std::memory_order_relaxed);
  return estimate;
}

timesync::SynchroniserStreams synchroniser_streams(Run& run) {
  const Ports ports = run.ports();
  timesync::SynchroniserStreams described{.camera = ports.camera->stamps(),
                                          .timeshift_cam_imu = run.calibration.timeshift_cam_imu};
  if (ports.imu != nullptr) {
    described.imu = ports.imu->stamps();
    described.imu_on_camera_clock = described.imu->on_camera_clock;
  }
  if (ports.legs != nullptr) {
    described.legs = ports.legs->stamps();
  }
  return described;
}

}  // namespace geoflow::daemon
