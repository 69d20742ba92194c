#include "src/worker.hpp"

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/lock_step_runner.hpp"
#include "geoflow/daemon/pipeline.hpp"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/sources.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"

#include "map/map_keeper.hpp"
#include "service/source_watch.hpp"
#include "src/opener.hpp"

namespace geoflow::daemon {
namespace {

nlohmann::json to_json(const drivers::D435iStatus& camera) {
  return {{"streaming", camera.streaming},
          {"trouble", camera.trouble},
          {"transport", camera.transport},
          {"place", camera.place},
          {"super_speed", camera.super_speed},
          {"firmware", camera.firmware},
          {"depth_frames", camera.depth_frames},
          {"color_frames", camera.color_frames},
          {"damaged_frames", camera.damaged_frames},
          {"missed_frames", camera.missed_frames},
          {"imu_reports", camera.imu_reports},
          {"imu_unpaired", camera.imu_unpaired},
          {"stamped_by_arrival", camera.stamped_by_arrival},
          {"stalls", camera.stalls},
          {"stream_restarts", camera.stream_restarts},
          {"camera_restarts", camera.camera_restarts},
          {"port_resets", camera.port_resets},
          {"hardware_resets", camera.hardware_resets},
          {"imu_restarts", camera.imu_restarts},
          {"losses", camera.losses},
          {"opens", camera.opens}};
}

}  // namespace

Worker::Worker(const Config& config, timesync::Doorbell& bell, timesync::Doorbell stop_opening,
               std::uint32_t earlier_resets)
    : config_{config},
      bell_{bell},
      earlier_resets_{earlier_resets},
      opener_{config, bell, std::move(stop_opening)} {}

Result<std::unique_ptr<Worker>> Worker::start(const Config& config, timesync::Doorbell& bell,
                                              std::uint32_t earlier_resets) {
  if (auto checked = check_source(config); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  auto stop_opening = timesync::Doorbell::create();
  if (!stop_opening) {
    return tl::unexpected{std::move(stop_opening.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<Worker>{
      new Worker{config, bell, std::move(*stop_opening), earlier_resets}};
}

Result<void> Worker::proceed() {
  auto opened = opener_.take();
  if (!opened) {
    return {};
  }
  if (!*opened) {
    return tl::unexpected{std::move(opened->error())};
  }
  run_ = std::make_unique<Run>(std::move(**opened));
  if (const std::optional<Error>& refused = run_->map_refused) {
    log::warning("map", "begins without a saved map: {}", refused->message);
  }
  return launch();
}

Result<void> Worker::launch() {
  auto keeper = MapKeeper::start(*run_, config_, bell_, [this] { wake_estimator(); });
  if (!keeper) {
    return tl::unexpected{std::move(keeper.error())};
  }
  keeper_ = std::move(*keeper);
  PipelineHandlers handlers{
      .on_estimate = [this](const SyncedPacket& packet,
                            const PoseEstimate& estimate) { publish(packet, estimate); },
      .on_end = [this] { end(); },
      .on_propagated =
          [this](const PropagatedPose& pose) {
            propagated_.store(make_pose(pose, context(pose.estimate.t)));
            bell_.ring();
          },
      .between_frames = [this] { return keeper_->between_frames(); }};
  if (config_.source.realtime) {
    return launch_pipeline(std::move(handlers));
  }
  launch_lock_step(std::move(handlers));
  return {};
}

Result<void> Worker::launch_pipeline(PipelineHandlers handlers) {
  auto pipeline = Pipeline::start(*run_, config_, std::move(handlers));
  return std::move(pipeline).map([this](auto started) { pipeline_ = std::move(started); });
}

void Worker::launch_lock_step(PipelineHandlers handlers) {
  lock_step_ = std::jthread{[this, handlers = std::move(handlers)](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "slam");
    LockStepRunner runner{*run_, config_, handlers.on_estimate, handlers.on_propagated,
                          handlers.between_frames};
    const auto done = runner.run(stop);
    if (!done) {
      log::error("replay", "{}", done.error().message);
    }
    if (!stop.stop_requested()) {
      end();
    }
  }};
}

/// In lock step it never waits.
void Worker::wake_estimator() {
  if (pipeline_) {
    pipeline_->wake();
  }
}

void Worker::publish(const SyncedPacket& packet, const PoseEstimate& estimate) {
  const geoflow_pose pose = make_pose(packet, estimate, context(estimate.t));
  newest_.store(pose);
  if (wants_images_.load(std::memory_order_relaxed)) {
    images_.store({.color = packet.color,
                   .depth = packet.depth,
                   .depth_offset = packet.depth_offset,
                   .t_capture_ns = pose.t_capture_ns,
                   .t_recording_ns = pose.t_recording_ns,
                   .frame = pose.frame});
  }
  bell_.ring();
}

PoseContext Worker::context(HostTime t) const {
  const RunCounters& counters = run_->statistics->counters;
  return {.t_publish = HostClock::now(),
          .t_recording = run_->to_recording_time(t),
          .clock_flags = clock_flags(config_.source),
          .earlier_resets = earlier_resets_,
          .frames_dropped = counters.color_dropped.load(std::memory_order_relaxed) +
                            counters.packets_dropped.load(std::memory_order_relaxed)};
}

void Worker::end() {
  ended_.store(true, std::memory_order_release);
  bell_.ring();
}

void Worker::stop() {
  if (pipeline_) {
    pipeline_->stop();
  }
  if (lock_step_.joinable()) {
    lock_step_.request_stop();
    lock_step_.join();
  }
  if (keeper_) {
    keeper_->stop();
    if (const auto outcome = keeper_->save_at_end(); outcome && !outcome->report) {
      log::error("map", "not saved: {}", outcome->report.error().message);
    }
  }
  keeper_.reset();
  pipeline_.reset();  // which the keeper wakes
}

nlohmann::json Worker::status() {
  nlohmann::json status = run_ ? to_json(*run_->statistics) : to_json(RunStatistics{});
  nlohmann::json& source = status["source"];
  source = {{"path", config_.source.replay.string()},
            {"format", config_.source.camera},
            {"open", is_open()},
            {"trouble", trouble()},
            {"realtime", config_.source.realtime}};
  if (!run_) {
    return status;
  }
  source["calibration"] = run_->calibration.source;
  if (!run_->camera) {
    source["format"] = run_->streams->info().format;
  } else if (const auto* d435i = dynamic_cast<const drivers::D435i*>(run_->camera.get())) {
    status["d435i"] = to_json(d435i->status());
  }
  return status;
}

std::vector<ThreadActivity> Worker::threads() const {
  std::vector<ThreadActivity> threads;
  if (pipeline_) {
    threads = pipeline_->threads();
  } else if (lock_step_.joinable()) {
    threads = {{.name = "slam", .turns = run_->activity().turns + frames(), .idle = ended()}};
  } else {
    threads = {opener_.activity()};
  }
  if (keeper_) {
    threads.push_back(keeper_->activity());
  }
  return threads;
}

std::vector<service::SourceReport> Worker::sources() {
  std::vector<service::SourceReport> reports;
  if (run_) {
    const Ports ports = run_->ports();
    reports.push_back({.name = "camera", .health = ports.camera->health()});
    if (ports.imu != nullptr) {
      reports.push_back({.name = "imu", .health = ports.imu->health()});
    }
    if (ports.legs != nullptr) {
      reports.push_back({.name = "legs", .health = ports.legs->health()});
    }
  }
  return reports;
}

std::uint64_t Worker::frames() const noexcept {
  return run_ ? run_->statistics->frames() : 0;
}

std::uint32_t Worker::clock_flags(const SourceConfig& source) noexcept {
  if (!source.camera.empty()) {
    return 0;
  }
  return source.realtime ? std::uint32_t{GEOFLOW_CLOCK_REPLAY}
                         : GEOFLOW_CLOCK_REPLAY | GEOFLOW_CLOCK_UNPACED;
}

}  // namespace geoflow::daemon
