#include "geoflow/daemon/lock_step_runner.hpp"

#include <atomic>
#include <stop_token>
#include <utility>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/timesync/synchroniser.hpp"

#include "pipeline/estimation.hpp"
#include "pipeline/propagation.hpp"

namespace geoflow::daemon {
namespace {

/// Hands every sample straight on.
class DirectReceiver final : public SampleReceiver {
 public:
  DirectReceiver(timesync::Synchroniser& synchroniser, Propagation& propagation,
                 RunCounters& counters)
      : synchroniser_{synchroniser}, propagation_{propagation}, counters_{counters} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    counters_.color_frames.fetch_add(1, std::memory_order_relaxed);
    synchroniser_.push_color(frame);
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    counters_.depth_frames.fetch_add(1, std::memory_order_relaxed);
    synchroniser_.push_depth(frame);
  }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    propagation_.push(synchroniser_, sample);
  }
  void on_legs(const Arrival<LegClock, LegSample>& sample) override {
    propagation_.push(synchroniser_, sample);
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override {
    propagation_.push(synchroniser_, sample);
  }

 private:
  timesync::Synchroniser& synchroniser_;
  Propagation& propagation_;
  RunCounters& counters_;
};

}  // namespace

LockStepRunner::LockStepRunner(Run& run, const Config& config, EstimateHandler handler,
                               PropagatedHandler on_propagated, BetweenFrames between_frames)
    : run_{run},
      config_{config},
      handler_{std::move(handler)},
      on_propagated_{std::move(on_propagated)},
      between_frames_{std::move(between_frames)} {}

Result<void> LockStepRunner::run(const std::stop_token& stop) {
  timesync::Synchroniser synchroniser{config_.synchroniser, synchroniser_streams(run_)};
  Propagation propagation{run_.propagator.get(), on_propagated_};
  DirectReceiver receiver{synchroniser, propagation, run_.statistics->counters};
  StartedPorts ports{run_.ports()};
  auto started = ports.start(receiver);
  if (!started) {
    return started;
  }
  bool more = true;
  while (more && !stop.stop_requested()) {
    const auto stepped = run_.streams->step();
    if (!stepped) {
      run_.statistics->counters.rejected.fetch_add(1, std::memory_order_relaxed);
      log::debug("replay", "{}", stepped.error().message);
      continue;
    }
    more = *stepped;
    while (const auto packet = synchroniser.pop(run_.streams->now())) {
      propagation.correct(estimate(*packet));
    }
  }
  while (!more) {
    const auto packet = synchroniser.flush();
    if (!packet) {
      break;
    }
    (void)estimate(*packet);
  }
  run_.synchroniser = synchroniser.counters();
  return {};
}

PoseEstimate LockStepRunner::estimate(const SyncedPacket& packet) {
  RunCounters& counters = run_.statistics->counters;
  counters.packets.fetch_add(1, std::memory_order_relaxed);
  if (between_frames_) {
    (void)between_frames_();  // every mapping task has been applied
  }
  const PoseEstimate estimate = process_packet(run_, packet);
  handler_(packet, estimate);
  if (const auto task = run_.core->take_mapping_task()) {
    run_.core->apply(slam::optimise(*task, &run_.statistics->mapping));
    counters.mapping_runs.fetch_add(1, std::memory_order_relaxed);
  }
  if (const auto task = run_.core->take_global_task()) {
    run_.core->apply(slam::optimise(*task, &run_.statistics->global_mapping));
  }
  return estimate;
}

}  // namespace geoflow::daemon
