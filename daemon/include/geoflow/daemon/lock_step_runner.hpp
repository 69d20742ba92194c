#pragma once

#include <stop_token>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"

namespace geoflow::daemon {

/// Runs a recording through the estimator on the calling thread, as fast as it goes, everything in
/// packet order: sample
/// -> synchroniser -> Core::process -> mapping, optimised at once -> handler. The same recording
/// gives the same estimates bit for bit on one machine. Thread-bound.
class LockStepRunner {
 public:
  /// `run` and `config` must outlive it. Poses are propagated only where `on_propagated` is given;
  /// `between_frames` is called before each frame.
  LockStepRunner(Run& run, const Config& config, EstimateHandler handler,
                 PropagatedHandler on_propagated = {}, BetweenFrames between_frames = {});

  /// Runs to the recording's end, or until `stop`; then leaves the estimator as it is. Samples that
  /// cannot be decoded are counted, not fatal. An error only where a port cannot be started.
  [[nodiscard]] Result<void> run(const std::stop_token& stop);

 private:
  PoseEstimate estimate(const SyncedPacket& packet);

  Run& run_;
  const Config& config_;
  EstimateHandler handler_;
  PropagatedHandler on_propagated_;
  BetweenFrames between_frames_;
};

}  // namespace geoflow::daemon
