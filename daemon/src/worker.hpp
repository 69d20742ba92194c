#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <thread>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pipeline.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/latest.hpp"

namespace geoflow::daemon {

/// One run of the configured source in the background: the live pipeline, or lock step on one
/// thread. It rings the bell when there is a new pose and when it has ended. All calls from the
/// thread that started it.
class Worker {
 public:
  /// `earlier_resets`: what the pose's reset_counter starts from. `config` and `bell` must outlive
  /// it.
  [[nodiscard]] static Result<std::unique_ptr<Worker>> start(const Config& config,
                                                             timesync::Doorbell& bell,
                                                             std::uint32_t earlier_resets);
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() { stop(); }

  /// The newest pose, once.
  [[nodiscard]] std::optional<geoflow_pose> take_pose() { return newest_.take_new(); }
  /// The newest that was carried on to an IMU sample, once.
  [[nodiscard]] std::optional<geoflow_pose> take_propagated() { return propagated_.take_new(); }
  /// True when the source has ended; the last pose can then be taken.
  [[nodiscard]] bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// Ends all its threads and, the first time, saves the configured map.
  void stop();

  /// For the status reply.
  [[nodiscard]] nlohmann::json status() const;

  /// The clock flags of a configured source (geoflow_clock_flags).
  [[nodiscard]] static std::uint32_t clock_flags(const SourceConfig& source) noexcept;

 private:
  Worker(const Config& config, timesync::Doorbell& bell, std::uint32_t earlier_resets, Run run);
  [[nodiscard]] Result<void> launch();
  void publish(const SyncedPacket& packet, const PoseEstimate& estimate);
  [[nodiscard]] PoseContext context(HostTime t) const;
  void end();
  void save_map();

  const Config& config_;
  timesync::Doorbell& bell_;
  std::uint32_t earlier_resets_;
  Run run_;
  timesync::Latest<geoflow_pose> newest_;      // from the estimating thread to the loop's
  timesync::Latest<geoflow_pose> propagated_;  // from the synchronising thread to the loop's
  std::atomic<bool> ended_{false};
  std::unique_ptr<Pipeline> pipeline_;
  std::jthread lock_step_;
  bool map_saved_ = false;
};

}  // namespace geoflow::daemon
