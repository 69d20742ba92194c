#include "record/live_recorder.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <numeric>
#include <stop_token>
#include <thread>
#include <utility>
#include <variant>

#include <tl/expected.hpp>

#include "geoflow/daemon/sources.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "record/sample_queue.hpp"

namespace geoflow::tools {
namespace {

constexpr Duration kLongestWait = std::chrono::milliseconds{100};

/// Hands a sample of any kind to the writer's function for it.
struct Write {
  drivers::BagWriter& writer;

  void operator()(const Arrival<CameraClock, ColorFrame>& frame) const { writer.on_color(frame); }
  void operator()(const Arrival<CameraClock, DepthFrame>& frame) const { writer.on_depth(frame); }
  void operator()(const Arrival<ImuClock, ImuSample>& sample) const { writer.on_imu(sample); }
  void operator()(const Arrival<LegClock, LegSample>& sample) const { writer.on_legs(sample); }
  void operator()(const Arrival<LegClock, BodyVelocitySample>& sample) const {
    writer.on_body_velocity(sample);
  }
};

/// Writes the next sample; false where none came in time.
bool write_next(SampleQueue& queue, Duration timeout, drivers::BagWriter& writer,
                LiveCounts& counts) {
  const auto sample = queue.pop(timeout);
  if (sample) {
    std::visit(Write{writer}, *sample);
    ++counts.written.at(sample->index());
  }
  counts.dropped = queue.dropped();
  return sample.has_value();
}

}  // namespace

std::uint64_t LiveCounts::total() const noexcept {
  return std::accumulate(written.begin(), written.end(), std::uint64_t{0});
}

Result<LiveCounts> record_live(daemon::Sources& sources, drivers::BagWriter& writer,
                               const QueueLimits& limits, const GoOn& go_on) {
  SampleQueue queue{limits};
  daemon::StartedPorts ports{sources.ports()};
  if (auto started = ports.start(queue); !started) {
    return tl::unexpected{std::move(started.error())};
  }
  LiveCounts counts;
  Result<void> played;
  Result<void> written;
  {
    // Legs and an IMU alone have no end of their own.
    std::atomic<bool> over{false};
    const std::jthread source{
        [&, has_end = sources.ports().camera != nullptr](const std::stop_token& stop) {
          played = sources.play(stop);
          over.store(has_end, std::memory_order_release);
        }};
    while (written && !over.load(std::memory_order_acquire) && go_on(counts)) {
      (void)write_next(queue, kLongestWait, writer, counts);
      written = writer.status();
    }
  }
  ports.stop();
  while (written && write_next(queue, Duration::zero(), writer, counts)) {
    written = writer.status();
  }
  if (!played || !written) {
    return tl::unexpected{played ? std::move(written.error()) : std::move(played.error())};
  }
  return counts;
}

}  // namespace geoflow::tools
