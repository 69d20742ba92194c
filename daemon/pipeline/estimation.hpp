#pragma once

#include "geoflow/daemon/run.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

namespace geoflow::daemon {

/// Works on one packet, measures and counts. On the estimator's thread.
PoseEstimate process_packet(Run& run, const SyncedPacket& packet);

/// How the source's streams are stamped.
[[nodiscard]] timesync::SynchroniserStreams synchroniser_streams(drivers::RecordedStreams& streams);

}  // namespace geoflow::daemon
