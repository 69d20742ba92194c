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

Result<void> MapKeeper::begin(MapJob job) {
  if (busy_) {
    return fail(ErrorCode::kUnavailable, "the map is being worked on");
  }
  return (job == MapJob::kSave ? may_save() : Result<void>{}).map([&] {
    busy_ = true;
    wanted_.store(1 + static_cast<int>(job), std::memory_order_release);
    wake_();
  });
}

Result<void> MapKeeper::may_save() const {
  if (config_.map.file.empty()) {
    return fail(ErrorCode::kInvalidArgument, "map.file: no file is configured");
  }
  if (!file_is_ours_) {
    return fail(ErrorCode::kUnavailable,
                "the map's file was refused at the start and is left as it is: {}",
                run_.map_refused ? run_.map_refused->message : "");
  }
  return {};
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
  if (outcome->report && outcome->job == MapJob::kSave) {
    saved_ = outcome->report->mark;
  } else if (outcome->report && outcome->job == MapJob::kForget) {
    saved_.reset();
    file_is_ours_ = true;
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
  if (const int wanted = wanted_.exchange(0, std::memory_order_acq_rel); wanted != 0) {
    const auto job = static_cast<MapJob>(wanted - 1);
    // One job is under way at a time, so there is room for its task, and later for its core.
    (void)tasks_.try_push({.job = job,
                           .map = job == MapJob::kForget ? nullptr : run_.core->snapshot(),
                           .mark = mark()});
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
  if (task.job == MapJob::kSave) {
    finish(task.job, save(task));
    return;
  }
  auto begun = begin_anew(task);
  if (begun) {
    waiting_ = std::move(*begun);
    wake_();
  } else {
    finish(task.job, std::move(begun));
  }
}

Result<MapReport> MapKeeper::save(const Task& task) const {
  return write(*task.map, config_.map.file, task.mark);
}

Result<MapReport> MapKeeper::begin_anew(const Task& task) {
  auto report = task.job == MapJob::kForget
                    ? move_file_aside()
                    : Result<MapReport>{MapReport{.keyframes = slam::summary(*task.map).keyframes}};
  return std::move(report).and_then([&](MapReport ready) {
    ready.job = task.job;
    return slam::Core::create(run_.calibration, config_.slam, &run_.statistics->tracking,
                              task.map.get())
        .map([&](std::unique_ptr<slam::Core> core) {
          (void)fresh_.try_push(std::move(core));
          return std::move(ready);
        });
  });
}

Result<MapReport> MapKeeper::move_file_aside() const {
  const std::filesystem::path& file = config_.map.file;
  std::error_code failure;
  if (file.empty() || !std::filesystem::exists(file, failure)) {
    return MapReport{};
  }
  std::filesystem::path aside = file;
  aside += ".old";
  std::filesystem::rename(file, aside, failure);
  if (failure) {
    return fail(ErrorCode::kSystem, "{}: cannot be renamed to {}: {}", file.string(),
                aside.string(), failure.message());
  }
  return MapReport{.file = file, .moved = aside};
}

void MapKeeper::finish(MapJob job, Result<MapReport> report) {
  (void)outcomes_.try_push({.job = job, .report = std::move(report)});
  done_.ring();
}

}  // namespace geoflow::daemon
