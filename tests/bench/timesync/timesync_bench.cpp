#include <cstddef>
#include <cstdint>
#include <random>
#include <stop_token>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_model.hpp"
#include "geoflow/timesync/drop_oldest_ring.hpp"
#include "geoflow/timesync/latest.hpp"
#include "geoflow/timesync/spsc_ring.hpp"
#include "geoflow/timesync/synchroniser.hpp"

/// What each sample costs on its way through timesync.
namespace geoflow::timesync {
namespace {

constexpr std::size_t kRingCapacity = 1024;
constexpr std::int64_t kImuPeriodNs = 2'000'000;  // 500 Hz
constexpr std::int64_t kFramePeriodNs = 33'333'333;

void spsc_ring_push_pop(benchmark::State& state) {
  SpscRing<std::uint64_t> ring{kRingCapacity};
  std::uint64_t value = 0;
  while (state.KeepRunning()) {
    benchmark::DoNotOptimize(ring.try_push(value++));
    benchmark::DoNotOptimize(ring.try_pop());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(spsc_ring_push_pop);

/// Throughput from one thread to another.
void spsc_ring_two_threads(benchmark::State& state) {
  SpscRing<std::uint64_t> ring{kRingCapacity};
  const std::jthread consumer{[&ring](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      if (!ring.try_pop()) {
        std::this_thread::yield();
      }
    }
  }};
  std::uint64_t value = 0;
  while (state.KeepRunning()) {
    while (!ring.try_push(value)) {
      std::this_thread::yield();
    }
    ++value;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(spsc_ring_two_threads)->UseRealTime();

void drop_oldest_ring_full(benchmark::State& state) {
  DropOldestRing<std::uint64_t> ring{4};
  std::uint64_t value = 0;
  while (state.KeepRunning()) {
    ring.push(value++);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(drop_oldest_ring_full);

void latest_store_load(benchmark::State& state) {
  Latest<std::uint64_t> latest;
  std::uint64_t value = 0;
  while (state.KeepRunning()) {
    latest.store(value++);
    benchmark::DoNotOptimize(latest.load());
  }
}
BENCHMARK(latest_store_load);

void clock_model_add(benchmark::State& state) {
  constexpr double kMeanDelayNs = 300e3;
  constexpr std::size_t kDelays = 4096;
  std::mt19937_64 random{1};
  std::exponential_distribution<double> delay{1.0 / kMeanDelayNs};
  std::vector<std::int64_t> delays_ns(kDelays);
  for (auto& one : delays_ns) {
    one = static_cast<std::int64_t>(delay(random));
  }
  ClockModel<ImuClock> model{{.domain = StampDomain::kDevice}};
  std::int64_t t_ns = 0;
  std::size_t i = 0;
  while (state.KeepRunning()) {
    t_ns += kImuPeriodNs;
    const std::int64_t arrival_ns = t_ns + delays_ns[i++ % kDelays];
    benchmark::DoNotOptimize(
        model.add(DeviceTime<ImuClock>{Duration{t_ns}}, HostTime{Duration{arrival_ns}}));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(clock_model_add);

/// One packet at 30 Hz with its share of 500 Hz IMU and legs, device clocks on all.
void synchroniser_packet(benchmark::State& state) {
  const StampInfo device{.domain = StampDomain::kDevice};
  Synchroniser sync{{}, {.camera = device, .imu = device, .legs = device}};
  FramePool pool{8};
  const FrameRef frame = pool.acquire({.width = 2, .height = 1});
  std::int64_t t_ns = 0;
  std::int64_t next_frame_ns = 0;
  std::int64_t packets = 0;
  while (state.KeepRunning()) {
    next_frame_ns += kFramePeriodNs;
    for (; t_ns < next_frame_ns + kImuPeriodNs; t_ns += kImuPeriodNs) {
      const Duration t{t_ns};
      sync.push_imu({DeviceTime<ImuClock>{t}, HostTime{t}, {}});
      sync.push_legs({DeviceTime<LegClock>{t}, HostTime{t}, {}});
    }
    const Duration t{next_frame_ns};
    sync.push_color({DeviceTime<CameraClock>{t}, HostTime{t}, ColorFrame{frame}});
    sync.push_depth({DeviceTime<CameraClock>{t}, HostTime{t}, DepthFrame{frame}});
    while (auto packet = sync.pop(HostTime{Duration{t_ns}})) {
      benchmark::DoNotOptimize(packet->imu.data());
      ++packets;
    }
  }
  state.SetItemsProcessed(packets);
}
BENCHMARK(synchroniser_packet);

}  // namespace
}  // namespace geoflow::timesync
