#include "pipeline/map_worker.hpp"

#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include <pthread.h>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/thread.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"
#include "geoflow/timesync/doorbell.hpp"

namespace geoflow::daemon {

using timesync::Doorbell;

MapWorker::MapWorker(const char* name, Doorbell bell, Doorbell& answers,
                     slam::StageObserver& observer)
    : name_{name}, bell_{std::move(bell)}, answers_{answers}, observer_{observer} {}

void MapWorker::start() {
  thread_ = std::jthread{[this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), name_);
    const std::stop_callback stop_bell{stop, [this] { bell_.stop(); }};
    work(stop);
  }};
}

void MapWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void MapWorker::give(slam::MappingTask task) {
  busy_ = tasks_.try_push(std::move(task));
  bell_.ring();
}

std::optional<slam::MappingResult> MapWorker::take() {
  auto result = results_.try_pop();
  if (result) {
    busy_ = false;
    if (std::exchange(forgotten_, false)) {
      result.reset();
    }
  }
  return result;
}

ThreadActivity MapWorker::activity() const noexcept {
  ThreadActivity activity = pulse_.activity(name_, bell_);
  activity.long_work = true;
  return activity;
}

void MapWorker::work(const std::stop_token& stop) {
  give_way();
  bool stopped = false;
  while (!stopped) {
    if (const auto task = tasks_.try_pop()) {
      // One task is out at a time, so there is room for its result.
      (void)results_.try_push(slam::optimise(*task, &observer_));
      answers_.ring();
      pulse_.turn();
      stopped = stop.stop_requested();
    } else {
      stopped = pulse_.wait(bell_) == Doorbell::Wake::kStopped;
    }
  }
}

}  // namespace geoflow::daemon
