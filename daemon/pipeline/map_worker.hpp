#pragma once

#include <optional>
#include <stop_token>
#include <thread>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/spsc_ring.hpp"

#include "pipeline/pulse.hpp"

namespace geoflow::daemon {

/// Works on tasks about the map, one at a time, in a thread of its own at low priority: a frame
/// must not wait for the map. All but activity() is for one other thread, the estimator's.
class MapWorker {
 public:
  /// `name` is the thread's; `answers` is rung when a result is there, and `observer` told of the
  /// stages. All three must outlive the worker.
  MapWorker(const char* name, timesync::Doorbell bell, timesync::Doorbell& answers,
            slam::StageObserver& observer);
  MapWorker(const MapWorker&) = delete;
  MapWorker& operator=(const MapWorker&) = delete;
  ~MapWorker() { stop(); }

  void start();
  /// Ends the thread, after the task that it works on.
  void stop();

  /// A task is out whose result has not been taken.
  [[nodiscard]] bool busy() const noexcept { return busy_; }
  /// Precondition: not busy().
  void give(slam::MappingTask task);
  /// The result, once it is there; none of a task that was to be forgotten.
  [[nodiscard]] std::optional<slam::MappingResult> take();
  /// The task that is out is a former estimator's.
  void forget() noexcept { forgotten_ = busy_; }

  /// Any thread.
  [[nodiscard]] ThreadActivity activity() const noexcept;

 private:
  void work(const std::stop_token& stop);

  const char* name_;
  timesync::Doorbell bell_;
  timesync::Doorbell& answers_;
  slam::StageObserver& observer_;
  Pulse pulse_;
  timesync::SpscRing<slam::MappingTask> tasks_{1};
  timesync::SpscRing<slam::MappingResult> results_{1};
  bool busy_ = false;
  bool forgotten_ = false;
  std::jthread thread_;
};

}  // namespace geoflow::daemon
