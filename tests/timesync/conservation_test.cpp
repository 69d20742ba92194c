#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/synchroniser.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

#include "scripted_streams.hpp"

/// Laws of the synchroniser under any sequence of calls.
namespace geoflow::timesync::tests {
namespace {

enum class Act : std::uint8_t { kColor, kDepth, kImu, kLegs, kBodyVelocity, kPop };
constexpr int kActs = 6;

/// One call: the stream's clock goes on by `step_ms` (back, too), the sample arrives `delay_ms`
/// later.
struct Call {
  Act act = Act::kPop;
  int step_ms = 0;
  int delay_ms = 0;
  bool broken = false;
};

/// Mostly orderly, but with repeated, reordered and broken samples, gaps, and now and then an
/// absurd step.
rc::Gen<Call> call() {
  return rc::gen::construct<Call>(
      rc::gen::map(rc::gen::inRange(0, kActs), [](int act) { return static_cast<Act>(act); }),
      rc::gen::weightedOneOf<int>({{20, rc::gen::inRange(0, 40)},
                                   {4, rc::gen::inRange(-60, 1)},
                                   {2, rc::gen::inRange(100, 1000)},
                                   {1, rc::gen::inRange(-100'000, 100'000)}}),
      rc::gen::weightedOneOf<int>({{5, rc::gen::inRange(0, 5)}, {1, rc::gen::inRange(0, 500)}}),
      rc::gen::weightedOneOf<bool>({{15, rc::gen::just(false)}, {1, rc::gen::just(true)}}));
}

/// Runs calls against a synchroniser and keeps what comes out.
class Script {
 public:
  Script(const SynchroniserConfig& config, const SynchroniserStreams& streams)
      : sync{config, streams} {}

  void play(const Call& call) {
    auto& t_ms = stream_ms_[static_cast<std::size_t>(call.act)];
    t_ms += call.step_ms;
    now_ms_ = std::max(now_ms_, t_ms + call.delay_ms);
    switch (call.act) {
      case Act::kColor:
        return sync.push_color(spoilt(color(t_ms, call.delay_ms), call.broken));
      case Act::kDepth:
        return sync.push_depth(spoilt(depth(t_ms, call.delay_ms), call.broken));
      case Act::kImu:
        sync.push_imu(spoilt(imu(t_ms, call.delay_ms), call.broken));
        return;
      case Act::kLegs:
        sync.push_legs(spoilt(legs(t_ms, call.delay_ms), call.broken));
        return;
      case Act::kBodyVelocity:
        sync.push_body_velocity(spoilt(body_velocity(t_ms, call.delay_ms), call.broken));
        return;
      case Act::kPop:
        for (auto& packet : pop_all(sync, now_ms_)) {
          packets.push_back(packet);
        }
    }
  }
  void finish() {
    for (auto& packet : flush_all(sync)) {
      packets.push_back(packet);
    }
  }

  Synchroniser sync;
  std::vector<SyncedPacket> packets;

 private:
  template <typename A>
  static A spoilt(A arrival, bool broken) {
    if (broken) {
      arrival.t_device = decltype(arrival.t_device)::max();
    }
    return arrival;
  }

  std::array<double, kActs> stream_ms_{};
  double now_ms_ = 0;
};

template <typename Sample>
void assert_window(const std::vector<Timed<Sample>>& window, std::optional<HostTime> after,
                   HostTime until, std::set<std::int64_t>& seen) {
  std::size_t before = 0;
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < window.size(); ++i) {
    const bool in_order = i == 0 || window[i - 1].t < window[i].t;
    RC_ASSERT(in_order);
    before += after && window[i].t <= *after ? 1U : 0U;
    beyond += window[i].t > until ? 1U : 0U;
    seen.insert(window[i].t.time_since_epoch().count());
  }
  RC_ASSERT(before <= 1U);
  RC_ASSERT(beyond <= 1U);
}

/// Samples of device-clocked streams are moved by their clock model: only their number can be
/// compared.
void assert_conserved(const StreamCounters& counters, std::size_t seen) {
  RC_ASSERT(counters.pushed == counters.settled());
  RC_ASSERT(counters.used == seen);
}

void assert_laws(Script& script) {
  std::optional<HostTime> last;
  std::array<std::set<std::int64_t>, kActs> seen;
  std::set<const void*> depths;
  std::size_t blind = 0;
  for (std::size_t i = 0; i < script.packets.size(); ++i) {
    const SyncedPacket& packet = script.packets[i];
    RC_ASSERT(packet.sequence == i);
    const bool later =
        !last || packet.t > *last;  // outside RC_ASSERT, which does not short-circuit
    RC_ASSERT(later);
    blind += packet.color ? 0U : 1U;
    RC_ASSERT(std::chrono::abs(packet.depth_offset) <= SynchroniserConfig{}.depth_tolerance);
    if (packet.depth) {
      depths.insert(packet.depth.bytes().data());
    }
    assert_window(packet.imu, last, packet.t, seen[0]);
    assert_window(packet.legs, last, packet.t, seen[1]);
    assert_window(packet.body_velocity, last, packet.t, seen[2]);
    last = packet.t;
  }
  const SynchroniserCounters& counters = script.sync.counters();
  RC_ASSERT(counters.packets == script.packets.size());
  RC_ASSERT(counters.blind == blind);
  assert_conserved(counters.color, script.packets.size() - blind);
  assert_conserved(counters.depth, depths.size());
  assert_conserved(counters.imu, seen[0].size());
  assert_conserved(counters.legs, seen[1].size());
  assert_conserved(counters.body_velocity, seen[2].size());
}

Script play_all(const std::vector<Call>& calls, StampDomain domain) {
  const StampInfo stamps{.domain = domain};
  Script script{{.frame_capacity = 6, .sample_capacity = 12},
                {.camera = stamps, .imu = stamps, .legs = stamps}};
  for (const Call& one : calls) {
    script.play(one);
  }
  script.finish();
  return script;
}

RC_GTEST_PROP(Conservation, EverySampleEndsInAPacketOrInOneCounter, ()) {
  const auto calls = *rc::gen::container<std::vector<Call>>(150, call());
  Script script = play_all(calls, StampDomain::kHost);
  assert_laws(script);
}

RC_GTEST_PROP(Conservation, HoldsForDeviceClocksToo, ()) {
  const auto calls = *rc::gen::container<std::vector<Call>>(150, call());
  Script script = play_all(calls, StampDomain::kDevice);
  assert_laws(script);
}

RC_GTEST_PROP(Conservation, TheSameCallsGiveTheSamePackets, ()) {
  const auto calls = *rc::gen::container<std::vector<Call>>(80, call());
  const Script one = play_all(calls, StampDomain::kDevice);
  const Script two = play_all(calls, StampDomain::kDevice);
  RC_ASSERT(one.packets.size() == two.packets.size());
  for (std::size_t i = 0; i < one.packets.size(); ++i) {
    RC_ASSERT(one.packets[i].t == two.packets[i].t);
    RC_ASSERT(one.packets[i].error_bound == two.packets[i].error_bound);
    RC_ASSERT(one.packets[i].depth_offset == two.packets[i].depth_offset);
    RC_ASSERT(times_ms(one.packets[i].imu) == times_ms(two.packets[i].imu));
  }
}

}  // namespace
}  // namespace geoflow::timesync::tests
