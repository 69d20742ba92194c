#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pipeline.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/latest.hpp"

#include "map/map_keeper.hpp"
#include "service/source_watch.hpp"
#include "src/opener.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {

/// One run of the configured source in the background: first it is opened, which for a camera may
/// take until it is there; then the live pipeline, or lock step on one thread. It rings the bell
/// when the source is open, when there is a new pose and when it has ended. All calls from the
/// thread that started it.
class Worker {
 public:
  /// Begins to open the source. `earlier_resets`: what the pose's reset_counter starts from.
  /// `config` and `bell` must outlive it. Errors: those of check_source().
  [[nodiscard]] static Result<std::unique_ptr<Worker>> start(const Config& config,
                                                             timesync::Doorbell& bell,
                                                             std::uint32_t earlier_resets);
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() { stop(); }

  /// Takes the source over as soon as it is open; to be called when the bell rings. Errors: of a
  /// recording that cannot be opened, and of the threads' start.
  [[nodiscard]] Result<void> proceed();
  /// The source is open: poses can be expected.
  [[nodiscard]] bool is_open() const noexcept { return run_ != nullptr; }
  /// Why the source is not open yet: a sentence, or empty.
  [[nodiscard]] const std::string& trouble() { return opener_.trouble(); }

  /// The newest pose, once.
  [[nodiscard]] std::optional<geoflow_pose> take_pose() { return newest_.take_new(); }
  /// The newest that was carried on to an IMU sample, once.
  [[nodiscard]] std::optional<geoflow_pose> take_propagated() { return propagated_.take_new(); }
  /// The images of the newest frame, once; none while they are not wanted.
  [[nodiscard]] std::optional<Images> take_images() { return images_.take_new(); }
  void want_images(bool wanted) noexcept { wants_images_.store(wanted, std::memory_order_relaxed); }
  /// The source's; to be called once that is open.
  [[nodiscard]] const Calibration& calibration() const { return run_->calibration; }
  /// True when the source has ended; the last pose can then be taken.
  [[nodiscard]] bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// Ends all its threads and, the first time, saves the configured map.
  void stop();

  /// Work on the map in the background, once the source is open; null before.
  [[nodiscard]] MapKeeper* map() noexcept { return keeper_.get(); }

  /// For the status reply.
  [[nodiscard]] nlohmann::json status();
  /// What its threads show of themselves.
  [[nodiscard]] std::vector<ThreadActivity> threads() const;
  /// How the sources are; empty until the source is open.
  [[nodiscard]] std::vector<service::SourceReport> sources();
  /// Frames with an estimate so far.
  [[nodiscard]] std::uint64_t frames() const noexcept;

  /// The clock flags of a configured source (geoflow_clock_flags).
  [[nodiscard]] static std::uint32_t clock_flags(const SourceConfig& source) noexcept;

 private:
  Worker(const Config& config, timesync::Doorbell& bell, timesync::Doorbell stop_opening,
         std::uint32_t earlier_resets);
  [[nodiscard]] Result<void> launch();
  void publish(const SyncedPacket& packet, const PoseEstimate& estimate);
  [[nodiscard]] PoseContext context(HostTime t) const;
  void end();
  void wake_estimator();
  [[nodiscard]] Result<void> launch_pipeline(PipelineHandlers handlers);
  void launch_lock_step(PipelineHandlers handlers);

  const Config& config_;
  timesync::Doorbell& bell_;
  std::uint32_t earlier_resets_;
  std::unique_ptr<Run> run_;                   // null until the source is open
  timesync::Latest<geoflow_pose> newest_;      // from the estimating thread to the loop's
  timesync::Latest<geoflow_pose> propagated_;  // from the synchronising thread to the loop's
  timesync::Latest<Images> images_;            // from the estimating thread to the loop's
  std::atomic<bool> wants_images_{false};
  std::atomic<bool> ended_{false};
  std::unique_ptr<MapKeeper> keeper_;
  std::unique_ptr<Pipeline> pipeline_;
  std::jthread lock_step_;
  Opener opener_;
};

}  // namespace geoflow::daemon
