#include "pipeline/estimation.hpp"

#include <atomic>
#include <cstddef>

#include "geoflow/daemon/run.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

namespace geoflow::daemon {

PoseEstimate process_packet(Run& run, const SyncedPacket& packet) {
  const HostTime begin = HostClock::now();
  const PoseEstimate estimate = run.core->process(packet);
  run.statistics->process.add(HostClock::now() - begin);
  run.statistics->counters.by_status.at(static_cast<std::size_t>(estimate.status))
      .fetch_add(1, std::memory_order_relaxed);
  return estimate;
}

timesync::SynchroniserStreams synchroniser_streams(drivers::RecordedStreams& streams) {
  timesync::SynchroniserStreams described{
      .camera = streams.camera().stamps(),
      .timeshift_cam_imu = streams.calibration().timeshift_cam_imu};
  if (streams.imu() != nullptr) {
    described.imu = streams.imu()->stamps();
  }
  if (streams.legs() != nullptr) {
    described.legs = streams.legs()->stamps();
  }
  return described;
}

}  // namespace geoflow::daemon
