#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/spsc_ring.hpp"

#include "map/map_job.hpp"
#include "pipeline/pulse.hpp"

namespace geoflow::daemon {

/// Saves, and begins anew, the map of a run while that goes on. The estimator's thread only takes a
/// snapshot between two frames, or takes over an estimator that is ready; writing, and what else
/// takes its time, is done by a thread of its own at low priority. One job at a time.
///
/// Calls from the thread that made it, unless said otherwise.
class MapKeeper {
 public:
  /// `run`, `config` and `done` must outlive it. `wake` makes the estimator's thread call
  /// between_frames() soon; it is called from both the owner's and the keeper's thread. `done` is
  /// rung when there is an outcome. Error kSystem where the system has no descriptor left.
  [[nodiscard]] static Result<std::unique_ptr<MapKeeper>> start(Run& run, const Config& config,
                                                                timesync::Doorbell& done,
                                                                std::function<void()> wake);
  MapKeeper(const MapKeeper&) = delete;
  MapKeeper& operator=(const MapKeeper&) = delete;
  ~MapKeeper() = default;
  /// Ends its thread, after the file that is being written; the estimator's must have ended. Its
  /// last outcome can then be taken. Idempotent.
  void stop();

  /// A job is under way.
  [[nodiscard]] bool busy() const noexcept { return busy_; }
  /// Begins a job. Errors: kUnavailable while another one is under way, and where the map's file
  /// was refused and is not to be replaced; kInvalidArgument where a map without a file is to be
  /// saved, or kept aside.
  [[nodiscard]] Result<void> begin(const MapOrder& order);
  /// Of the job under way, once, when it is done.
  [[nodiscard]] std::optional<MapOutcome> take_outcome();
  /// After stop(): writes the map here and now, unless it was saved as it is. Nothing where there
  /// is no file, or the one that is there was refused.
  [[nodiscard]] std::optional<MapOutcome> save_at_end();
  /// The map is another one than what was saved last (none yet: than none), and can be saved.
  [[nodiscard]] bool has_news() const noexcept;

  /// How far the estimator is.
  [[nodiscard]] MapMark mark() const noexcept;

  /// The estimator's thread, between two frames. True when it has replaced run.core: nothing that
  /// belongs to the former one may be applied to it.
  [[nodiscard]] bool between_frames();

  [[nodiscard]] ThreadActivity activity() const noexcept;

 private:
  /// What the estimator's thread hands to the keeper's.
  struct Task {
    std::shared_ptr<const slam::StoredMap> map{};  // as it is
    MapMark mark{};
  };

  MapKeeper(Run& run, const Config& config, timesync::Doorbell& done, std::function<void()> wake,
            timesync::Doorbell bell);
  void work(const std::stop_token& stop);
  void take(const Task& task);
  [[nodiscard]] Result<MapReport> save(const Task& task) const;
  [[nodiscard]] static Result<MapReport> show(const Task& task);
  [[nodiscard]] Result<MapReport> begin_anew(const Task& task);
  [[nodiscard]] Result<std::shared_ptr<const slam::StoredMap>> map_for(const Task& task) const;
  [[nodiscard]] Result<std::filesystem::path> put_aside(const Task& task,
                                                        const slam::StoredMap* next) const;
  void finish(MapJob job, Result<MapReport> report);
  [[nodiscard]] Result<void> has_file() const;
  [[nodiscard]] Result<void> may_save() const;
  [[nodiscard]] Result<void> may_begin(MapJob job) const;

  Run& run_;
  const Config& config_;
  timesync::Doorbell& done_;
  std::function<void()> wake_;
  timesync::Doorbell bell_;
  Pulse pulse_;
  bool busy_ = false;                  // owner
  bool file_is_ours_;                  // owner's but while busy: it may be replaced
  MapOrder order_;                     // likewise: the job under way
  std::optional<MapMark> saved_;       // owner
  std::atomic<bool> wanted_{false};    // owner -> estimator: order_ is new
  timesync::SpscRing<Task> tasks_{1};  // estimator -> keeper
  timesync::SpscRing<std::unique_ptr<slam::Core>> fresh_{1};   // keeper -> estimator
  timesync::SpscRing<std::unique_ptr<slam::Core>> former_{1};  // estimator -> keeper
  std::optional<MapReport> waiting_;                           // keeper: for former_
  timesync::SpscRing<MapOutcome> outcomes_{1};                 // keeper -> owner
  std::jthread thread_;
};

}  // namespace geoflow::daemon
