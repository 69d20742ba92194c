#pragma once

#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

namespace geoflow::daemon {

/// Works on one packet, measures and counts. On the estimator's thread.
PoseEstimate process_packet(Run& run, const SyncedPacket& packet);

/// How the streams of the run's source are stamped.
[[nodiscard]] timesync::SynchroniserStreams synchroniser_streams(Run& run);

}  // namespace geoflow::daemon
