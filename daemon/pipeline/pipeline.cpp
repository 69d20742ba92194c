#include "geoflow/daemon/pipeline.hpp"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/thread.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/latest.hpp"
#include "geoflow/timesync/packet_queue.hpp"
#include "geoflow/timesync/synchroniser.hpp"

#include "pipeline/estimation.hpp"
#include "pipeline/map_worker.hpp"
#include "pipeline/propagation.hpp"
#include "pipeline/pulse.hpp"
#include "pipeline/sample_queues.hpp"

namespace geoflow::daemon {
namespace {

using timesync::Doorbell;

/// The signs of life of the threads that wait, but for those of the map's workers.
struct Pulses {
  Pulse sync;
  Pulse slam;
};

/// The doorbells of all.
struct Bells {
  Doorbell sync;
  Doorbell slam;
  Doorbell map;
  Doorbell global_map;

  static Result<Bells> create() {
    auto sync = Doorbell::create();
    auto slam = Doorbell::create();
    auto map = Doorbell::create();
    auto global_map = Doorbell::create();
    for (const auto* bell : {&sync, &slam, &map, &global_map}) {
      if (!*bell) {
        return tl::unexpected{bell->error()};
      }
    }
    return Bells{.sync = std::move(*sync),
                 .slam = std::move(*slam),
                 .map = std::move(*map),
                 .global_map = std::move(*global_map)};
  }
};

}  // namespace

class Pipeline::Implementation {
 public:
  Implementation(Run& run, const Config& config, PipelineHandlers handlers, Bells bells)
      : run_{run},
        on_estimate_{std::move(handlers.on_estimate)},
        on_end_{std::move(handlers.on_end)},
        between_frames_{std::move(handlers.between_frames)},
        bells_{std::move(bells)},
        queues_{config.pipeline, run.statistics->counters, bells_.sync},
        synchroniser_{config.synchroniser, synchroniser_streams(run)},
        propagation_{run.propagator.get(), measured(std::move(handlers.on_propagated))},
        packets_{static_cast<std::size_t>(config.pipeline.packet_queue),
                 config.synchroniser.sample_capacity},
        map_{"map", std::move(bells_.map), bells_.slam, run.statistics->mapping},
        global_map_{"global map", std::move(bells_.global_map), bells_.slam,
                    run.statistics->global_mapping},
        ports_{run.ports()},
        priority_{config.pipeline.priority} {}
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  ~Implementation() { stop(); }

  Result<void> start() {
    auto started = ports_.start(queues_);
    if (started) {
      // From the end of the chain, so that each thread finds the next one there.
      global_map_.start();
      map_.start();
      slam_ = launch("slam", &Implementation::slam, &bells_.slam);
      sync_ = launch("sync", &Implementation::synchronise, &bells_.sync);
      replay_ = launch("replay", &Implementation::replay, nullptr);
    }
    return started;
  }

  void stop() {
    for (std::jthread* thread : {&replay_, &sync_, &slam_}) {
      thread->request_stop();
    }
    for (std::jthread* thread : {&replay_, &sync_, &slam_}) {
      if (thread->joinable()) {
        thread->join();
      }
    }
    map_.stop();
    global_map_.stop();
    ports_.stop();
    run_.synchroniser = synchroniser_.counters();
  }

  void wake() noexcept { bells_.slam.ring(); }

  [[nodiscard]] std::vector<ThreadActivity> threads() const {
    ThreadActivity source = run_.activity();
    source.idle = source.idle || source_done_.load(std::memory_order_acquire);
    return {source, pulses_.sync.activity("sync", bells_.sync),
            pulses_.slam.activity("slam", bells_.slam), map_.activity(), global_map_.activity()};
  }

 private:
  /// Measures how long a sample's pose took.
  [[nodiscard]] PropagatedHandler measured(PropagatedHandler handler) const {
    if (!handler) {
      return {};
    }
    return [this, handler = std::move(handler)](const PropagatedPose& pose) {
      handler(pose);
      run_.statistics->propagation.add(HostClock::now() - pose.t_arrival);
    };
  }

  using Body = void (Implementation::*)(const std::stop_token&);

  /// A named thread; its stop token stops `bell` as well.
  std::jthread launch(const char* name, Body body, Doorbell* bell) {
    return std::jthread{[this, name, body, bell](const std::stop_token& stop) {
      ::pthread_setname_np(::pthread_self(), name);
      take_precedence();
      const std::stop_callback stop_bell{stop, [bell] {
                                           if (bell != nullptr) {
                                             bell->stop();
                                           }
                                         }};
      (this->*body)(stop);
    }};
  }

  /// Of the calling thread, as configured; that it is not allowed is said once for all threads.
  void take_precedence() {
    const auto taken = priority_ > 0 ? go_first(priority_) : Result<void>{};
    if (!taken && !refused_.test_and_set(std::memory_order_relaxed)) {
      log::warning("pipeline", "threads have no precedence: {}", taken.error().message);
    }
  }

  void replay(const std::stop_token& stop) {
    const auto played = run_.play(stop);
    if (!played) {
      log::error("replay", "{}", played.error().message);
    }
    run_.statistics->counters.rejected.store(run_.ports().camera->health().rejected);
    source_done_.store(!stop.stop_requested(), std::memory_order_release);
    bells_.sync.ring();
  }

  void synchronise(const std::stop_token& /*stop*/) {
    auto wake = Doorbell::Wake::kRung;
    bool done = false;
    while (!done && wake != Doorbell::Wake::kStopped) {
      done = source_done_.load(std::memory_order_acquire);
      if (const auto frame = frames_.take_new()) {
        propagation_.correct(*frame);
      }
      queues_.drain(synchroniser_, propagation_);
      const HostTime now = HostClock::now();
      while (auto packet = synchroniser_.pop(now)) {
        forward(std::move(*packet));
      }
      if (!done) {
        wake = pulses_.sync.wait(bells_.sync, time_to_deadline(now));
      }
    }
    while (auto packet = done ? synchroniser_.flush() : std::nullopt) {
      forward(std::move(*packet));
    }
    packets_done_.store(done, std::memory_order_release);
    bells_.slam.ring();
    pulses_.sync.end();
  }

  [[nodiscard]] std::optional<Duration> time_to_deadline(HostTime now) const {
    const auto deadline = synchroniser_.deadline();
    return deadline ? std::optional{std::max(*deadline - now, Duration::zero())} : std::nullopt;
  }

  void forward(SyncedPacket packet) {
    RunCounters& counters = run_.statistics->counters;
    counters.packets.fetch_add(1, std::memory_order_relaxed);
    packets_.push(std::move(packet));
    counters.packets_dropped.store(packets_.dropped(), std::memory_order_relaxed);
    bells_.slam.ring();
  }

  void slam(const std::stop_token& stop) {
    bool done = false;
    bool stopped = false;
    while (!done && !stopped) {
      done = packets_done_.load(std::memory_order_acquire);
      if (between_frames_ && between_frames_()) {
        map_.forget();
        global_map_.forget();
      }
      if (const auto packet = packets_.try_pop()) {
        done = false;
        estimate(*packet);
        pulses_.slam.turn();
        stopped = stop.stop_requested();
      } else if (!done) {
        stopped = pulses_.slam.wait(bells_.slam) == Doorbell::Wake::kStopped;
      }
    }
    if (!stopped) {
      finish_mapping();
      on_end_();
    }
    pulses_.slam.end();
  }

  void estimate(const SyncedPacket& packet) {
    take_over_mapping();
    const PoseEstimate estimate = process_packet(run_, packet);
    on_estimate_(packet, estimate);
    frames_.store(estimate);
    run_.statistics->delivery.add(HostClock::now() - packet.t_arrival);
    run_.core->extend_map();
    if (!map_.busy()) {
      if (auto task = run_.core->take_mapping_task()) {
        map_.give(std::move(*task));
      }
    }
    if (!global_map_.busy()) {
      if (auto task = run_.core->take_global_task()) {
        global_map_.give(std::move(*task));
      }
    }
  }

  void take_over_mapping() {
    if (const auto result = map_.take()) {
      run_.core->apply(*result);
      run_.statistics->counters.mapping_runs.fetch_add(1, std::memory_order_relaxed);
    }
    if (const auto result = global_map_.take()) {
      run_.core->apply(*result);
    }
  }

  /// At the source's end: what is still worked on goes into the final trajectory.
  void finish_mapping() {
    take_over_mapping();
    while ((map_.busy() || global_map_.busy()) &&
           pulses_.slam.wait(bells_.slam) != Doorbell::Wake::kStopped) {
      take_over_mapping();
    }
  }

  Run& run_;
  EstimateHandler on_estimate_;
  std::function<void()> on_end_;
  BetweenFrames between_frames_;
  Bells bells_;
  Pulses pulses_;
  SampleQueues queues_;
  timesync::Synchroniser synchroniser_;    // sync
  Propagation propagation_;                // sync
  timesync::Latest<PoseEstimate> frames_;  // slam -> sync
  timesync::PacketQueue packets_;          // sync -> slam
  std::atomic<bool> source_done_{false};
  std::atomic<bool> packets_done_{false};
  MapWorker map_;         // works for slam
  MapWorker global_map_;  // likewise, for seconds at a time
  StartedPorts ports_;
  int priority_;
  std::atomic_flag refused_{};
  std::jthread slam_;
  std::jthread sync_;
  std::jthread replay_;
};

Pipeline::Pipeline(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}
Pipeline::~Pipeline() = default;

Result<std::unique_ptr<Pipeline>> Pipeline::start(Run& run, const Config& config,
                                                  PipelineHandlers handlers) {
  auto bells = Bells::create();
  if (!bells) {
    return tl::unexpected{std::move(bells.error())};
  }
  auto implementation =
      std::make_unique<Implementation>(run, config, std::move(handlers), std::move(*bells));
  auto started = implementation->start();
  if (!started) {
    return tl::unexpected{std::move(started.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<Pipeline>{new Pipeline{std::move(implementation)}};
}

std::vector<ThreadActivity> Pipeline::threads() const {
  return implementation_->threads();
}

void Pipeline::wake() noexcept {
  implementation_->wake();
}

void Pipeline::stop() {
  implementation_->stop();
}

}  // namespace geoflow::daemon
