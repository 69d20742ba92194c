#include "map/map_keeper.hpp"

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <system_error>
#include <utility>

#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/thread.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/timesync/doorbell.hpp"

#include "map/map_cloud.hpp"
#include "map/map_files.hpp"
#include "map/map_job.hpp"

namespace geoflow::daemon {
namespace {

using timesync::Doorbell;

constexpr const char* kName = "save";

/// What was refused may be somebody's; only where nothing was, a new map may be.
bool may_replace(const Run& run) {
  return !run.map_refused || run.map_refused->code == ErrorCode::kNotFound;
}

Result<MapReport> write(const slam::StoredMap& map, const std::filesystem::path& file,
                        const MapMark& mark) {
  return slam::save_map(map, file).map([&] {
    std::error_code unknown;
    const std::uintmax_t bytes = std::filesystem::file_size(file, unknown);
    return MapReport{.job = MapJob::kSave,
                     .file = file,
                     .keyframes = slam::summary(map).keyframes,
                     .bytes = unknown ? 0 : bytes,
                     .mark = mark};
  });
}

}  // namespace

Result<std::unique_ptr<MapKeeper>> MapKeeper::start(Run& run, const Config& config, Doorbell& done,
                                                    std::function<void()> wake) {
  auto bell = Doorbell::create();
  if (!bell) {
    return tl::unexpected{std::move(bell.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<MapKeeper>{
      new MapKeeper{run, config, done, std::move(wake), std::move(*bell)}};
}

MapKeeper::MapKeeper(Run& run, const Config& config, Doorbell& done, std::function<void()> wake,
                     Doorbell bell)
    : run_{run},
      config_{config},
      done_{done},
      wake_{std::move(wake)},
      bell_{std::move(bell)},
      file_is_ours_{may_replace(run)},
      thread_{[this](const std::stop_token& stop) { work(stop); }} {}

void MapKeeper::stop() {
  thread_.request_stop();
  if (thread_.joinable()) {
    thread_.join();
  }
  // What has been forgotten must not be saved at the end.
  if (auto fresh = fresh_.try_pop()) {
    run_.core = std::move(*fresh);
  }
}

Result<void> MapKeeper::begin(const MapOrder& order) {
  if (busy_) {
    return fail(ErrorCode::kUnavailable, "the map is being worked on");
  }
  return may_begin(order.job).map([&] {
    busy_ = true;
    order_ = order;
    wanted_.store(true, std::memory_order_release);
    wake_();
  });
}

Result<void> MapKeeper::may_begin(MapJob job) const {
  switch (job) {
    case MapJob::kSave:
      return may_save();
    case MapJob::kLoad:
      return has_file();
    case MapJob::kRestart:
    case MapJob::kForget:
    case MapJob::kShow:
      break;
  }
  return {};
}

Result<void> MapKeeper::has_file() const {
  return config_.map.file.empty()
             ? fail(ErrorCode::kInvalidArgument, "map.file: no file is configured")
             : Result<void>{};
}

Result<void> MapKeeper::may_save() const {
  if (!file_is_ours_) {
    return fail(ErrorCode::kUnavailable,
                "the map's file was refused at the start and is left as it is: {}",
                run_.map_refused ? run_.map_refused->message : "");
  }
  return has_file();
}

bool MapKeeper::has_news() const noexcept {
  return may_save() && mark().mapping_runs != saved_.value_or(MapMark{}).mapping_runs;
}

std::optional<MapOutcome> MapKeeper::take_outcome() {
  auto outcome = outcomes_.try_pop();
  if (!outcome) {
    return std::nullopt;
  }
  busy_ = false;
  if (outcome->report) {
    switch (outcome->job) {
      case MapJob::kSave:
        saved_ = outcome->report->mark;
        break;
      case MapJob::kForget:
      case MapJob::kLoad:
        saved_.reset();
        file_is_ours_ = true;
        break;
      case MapJob::kRestart:
      case MapJob::kShow:
        break;
    }
  }
  return outcome;
}

std::optional<MapOutcome> MapKeeper::save_at_end() {
  (void)take_outcome();
  if (!may_save() || saved_ == mark()) {
    return std::nullopt;
  }
  return MapOutcome{.job = MapJob::kSave,
                    .report = write(*run_.core->snapshot(), config_.map.file, mark())};
}

MapMark MapKeeper::mark() const noexcept {
  return {.frames = run_.statistics->frames(),
          .mapping_runs = run_.statistics->counters.mapping_runs.load(std::memory_order_relaxed)};
}

bool MapKeeper::between_frames() {
  if (wanted_.exchange(false, std::memory_order_acq_rel)) {
    // One job is under way at a time, so there is room for its task, and later for its core.
    (void)tasks_.try_push({.map = run_.core->snapshot(), .mark = mark()});
    bell_.ring();
  }
  auto fresh = fresh_.try_pop();
  if (!fresh) {
    return false;
  }
  (void)former_.try_push(std::exchange(run_.core, std::move(*fresh)));
  run_.earlier_resets = run_.resets + 1;
  bell_.ring();
  return true;
}

ThreadActivity MapKeeper::activity() const noexcept {
  ThreadActivity activity = pulse_.activity(kName, bell_);
  activity.long_work = true;
  return activity;
}

void MapKeeper::work(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), kName);
  const std::stop_callback stop_bell{stop, [this] { bell_.stop(); }};
  give_way();
  bool stopped = false;
  while (!stopped) {
    if (const auto task = tasks_.try_pop()) {
      take(*task);
      pulse_.turn();
      stopped = stop.stop_requested();
    } else if (const auto former = former_.try_pop()) {
      const MapReport report = waiting_.value_or(MapReport{});
      finish(report.job, report);
    } else {
      stopped = pulse_.wait(bell_) == Doorbell::Wake::kStopped;
    }
  }
  pulse_.end();
}

void MapKeeper::take(const Task& task) {
  if (order_.job == MapJob::kSave) {
    finish(MapJob::kSave, save(task));
    return;
  }
  if (order_.job == MapJob::kShow) {
    finish(MapJob::kShow, show(task));
    return;
  }
  auto begun = begin_anew(task);
  if (begun) {
    waiting_ = std::move(*begun);
    wake_();
  } else {
    finish(order_.job, std::move(begun));
  }
}

Result<MapReport> MapKeeper::save(const Task& task) const {
  return write(*task.map, config_.map.file, task.mark);
}

Result<MapReport> MapKeeper::show(const Task& task) {
  return make_cloud(*task.map).map([&](MapCloud cloud) {
    return MapReport{.job = MapJob::kShow,
                     .mark = task.mark,
                     .cloud = std::make_shared<const MapCloud>(std::move(cloud))};
  });
}

Result<MapReport> MapKeeper::begin_anew(const Task& task) {
  auto map = map_for(task);
  if (!map) {
    return tl::unexpected{std::move(map.error())};
  }
  auto core =
      slam::Core::create(run_.calibration, config_.slam, &run_.statistics->tracking, map->get());
  if (!core) {
    return tl::unexpected{std::move(core.error())};
  }
  return put_aside(task, map->get()).map([&](const std::filesystem::path& moved) {
    (void)fresh_.try_push(std::move(*core));
    return MapReport{.job = order_.job,
                     .file = order_.file,
                     .moved = moved,
                     .keyframes = *map ? slam::summary(**map).keyframes : 0};
  });
}

/// That the estimator is to begin with; null: an empty one.
Result<std::shared_ptr<const slam::StoredMap>> MapKeeper::map_for(const Task& task) const {
  switch (order_.job) {
    case MapJob::kForget:
      return nullptr;
    case MapJob::kLoad:
      return load_own_map(order_.file, run_.calibration);
    case MapJob::kSave:
    case MapJob::kRestart:
    case MapJob::kShow:
      break;
  }
  return task.map;
}

/// Where the map of before is to be found from now on, if that is another one.
Result<std::filesystem::path> MapKeeper::put_aside(const Task& task,
                                                   const slam::StoredMap* next) const {
  switch (order_.job) {
    case MapJob::kForget:
      return move_aside(config_.map.file);
    case MapJob::kLoad:
      return replace_map(config_.map.file, *next, file_is_ours_ ? task.map.get() : nullptr);
    case MapJob::kSave:
    case MapJob::kRestart:
    case MapJob::kShow:
      break;
  }
  return std::filesystem::path{};
}

void MapKeeper::finish(MapJob job, Result<MapReport> report) {
  (void)outcomes_.try_push({.job = job, .report = std::move(report)});
  done_.ring();
}

}  // namespace geoflow::daemon
