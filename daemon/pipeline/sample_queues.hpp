#pragma once

#include <atomic>
#include <cstddef>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/drop_oldest_ring.hpp"
#include "geoflow/timesync/spsc_ring.hpp"
#include "geoflow/timesync/synchroniser.hpp"

#include "pipeline/propagation.hpp"

namespace geoflow::daemon {

/// The queues between the source's thread and the synchroniser's. The on_… functions are for the
/// source's thread and never block; drain() is for the synchroniser's.
class SampleQueues final : public SampleReceiver {
 public:
  SampleQueues(const PipelineConfig& config, RunCounters& counters, timesync::Doorbell& bell)
      : counters_{counters},
        bell_{bell},
        color_{static_cast<std::size_t>(config.image_queue)},
        depth_{static_cast<std::size_t>(config.image_queue)},
        imu_{static_cast<std::size_t>(config.sample_queue)},
        legs_{static_cast<std::size_t>(config.sample_queue)},
        body_velocity_{static_cast<std::size_t>(config.sample_queue)} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    counters_.color_frames.fetch_add(1, std::memory_order_relaxed);
    color_.push(frame);
    bell_.ring();
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    counters_.depth_frames.fetch_add(1, std::memory_order_relaxed);
    depth_.push(frame);
    bell_.ring();
  }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { push(imu_, sample); }
  void on_legs(const Arrival<LegClock, LegSample>& sample) override { push(legs_, sample); }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override {
    push(body_velocity_, sample);
  }

  /// Moves all that has come into the synchroniser, legs before the IMU, which asks for a pose;
  /// images last, so that what belongs to them is there.
  void drain(timesync::Synchroniser& synchroniser, Propagation& propagation) {
    while (const auto sample = legs_.try_pop()) {
      propagation.push(synchroniser, *sample);
    }
    while (const auto sample = body_velocity_.try_pop()) {
      propagation.push(synchroniser, *sample);
    }
    while (const auto sample = imu_.try_pop()) {
      propagation.push(synchroniser, *sample);
    }
    while (const auto frame = depth_.try_pop()) {
      synchroniser.push_depth(*frame);
    }
    while (const auto frame = color_.try_pop()) {
      synchroniser.push_color(*frame);
    }
    counters_.color_dropped.store(color_.dropped(), std::memory_order_relaxed);
    counters_.depth_dropped.store(depth_.dropped(), std::memory_order_relaxed);
  }

 private:
  template <typename Sample>
  void push(timesync::SpscRing<Sample>& ring, const Sample& sample) {
    if (!ring.try_push(sample)) {
      counters_.samples_dropped.fetch_add(1, std::memory_order_relaxed);
    }
    bell_.ring();
  }

  RunCounters& counters_;
  timesync::Doorbell& bell_;
  timesync::DropOldestRing<Arrival<CameraClock, ColorFrame>> color_;
  timesync::DropOldestRing<Arrival<CameraClock, DepthFrame>> depth_;
  timesync::SpscRing<Arrival<ImuClock, ImuSample>> imu_;
  timesync::SpscRing<Arrival<LegClock, LegSample>> legs_;
  timesync::SpscRing<Arrival<LegClock, BodyVelocitySample>> body_velocity_;
};

}  // namespace geoflow::daemon
