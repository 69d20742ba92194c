#include "can/snapshot.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/bus_fixture.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/leg_encoder.hpp"

namespace geoflow::drivers::can {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using tests::dictionary;
using tests::is_same;
using tests::kRoundPeriod;
using tests::rounds;
using tests::sample_of;

using Snapshots = std::vector<Arrival<LegClock, LegSample>>;
constexpr HostTime kBegin{std::chrono::seconds{100}};

/// Pushes frames and takes what comes out at each one's arrival, as a driver does.
Snapshots feed(SnapshotAssembler& assembler, const std::vector<Received>& frames) {
  Snapshots snapshots;
  for (const Received& received : frames) {
    (void)assembler.push(received);
    while (const auto snapshot = assembler.pop(received.t_arrival)) {
      snapshots.push_back(*snapshot);
    }
  }
  return snapshots;
}

std::vector<Received> without(std::vector<Received> frames,
                              const std::function<bool(const Received&)>& lost) {
  std::erase_if(frames, lost);
  return frames;
}

Duration device_time(std::uint64_t round) {
  return static_cast<std::int64_t>(round) * kRoundPeriod;
}

class BothBuses : public testing::TestWithParam<bool> {};

TEST_P(BothBuses, EveryRoundBecomesOneSnapshotOfItsOwnValues) {
  SnapshotAssembler assembler{dictionary()};
  constexpr std::uint64_t kRounds = 1000;
  const Snapshots snapshots = feed(assembler, rounds(250, kRounds, kBegin, GetParam()));
  // The last round is whole, and so is the first: which kinds of frames there are is known after
  // 20 ms, until then a round waits for the second one after it.
  ASSERT_EQ(snapshots.size(), kRounds);
  for (std::uint64_t i = 0; i < kRounds; ++i) {
    EXPECT_TRUE(is_same(snapshots[i].sample, sample_of(250 + i))) << i;
    EXPECT_EQ(snapshots[i].t_device.time_since_epoch(), device_time(250 + i));
    EXPECT_EQ(snapshots[i].t_arrival, kBegin + device_time(i));  // of its SYNC
  }
  const AssemblyCounters& counters = assembler.counters();
  EXPECT_EQ(counters.snapshots, kRounds);
  EXPECT_EQ(counters.incomplete + counters.empty + counters.gaps + counters.late, 0U);
  EXPECT_EQ(counters.duplicate + counters.restarts + counters.unplaced, 0U);
  EXPECT_EQ(assembler.stamps().domain, StampDomain::kDevice);
  EXPECT_EQ(assembler.stamps().wrap, Duration{167'772'160'000});
}

INSTANTIATE_TEST_SUITE_P(SnapshotAssembler, BothBuses, testing::Values(false, true),
                         [](const auto& bus) { return bus.param ? "Fd" : "Classic"; });

TEST(SnapshotAssembler, ASnapshotGoesOutWithTheLastOfItsFrames) {
  SnapshotAssembler assembler{dictionary()};
  (void)feed(assembler, rounds(0, 20, kBegin));
  const std::vector<Received> next = rounds(20, 1, kBegin + device_time(20));
  for (const Received& received : next) {
    (void)assembler.push(received);
    EXPECT_EQ(assembler.pop(received.t_arrival).has_value(), &received == &next.back());
  }
}

TEST(SnapshotAssembler, ASilentLegIsMarkedAndSoonNotWaitedFor) {
  SnapshotAssembler assembler{dictionary()};
  (void)feed(assembler, rounds(0, 20, kBegin));
  const auto no_front_left = without(rounds(20, 50, kBegin + device_time(20)), [](const auto& r) {
    return r.frame.id % 16 == 1 && r.frame.id > 0x100;
  });
  const Snapshots snapshots = feed(assembler, no_front_left);
  ASSERT_EQ(snapshots.size(), 50U);
  for (const auto& snapshot : snapshots) {
    EXPECT_THAT(snapshot.sample.valid, ElementsAre(true, false, true, true));
  }
  EXPECT_EQ(assembler.counters().incomplete, 50U);
  // At the end each round goes out with its own last frame again.
  EXPECT_EQ(snapshots.back().t_device.time_since_epoch(), device_time(69));
  EXPECT_LT(*assembler.last_heard(Leg::kFrontLeft), kBegin + device_time(20));
}

TEST(SnapshotAssembler, ALostFrameCostsItsLegOneSnapshotAndNoOtherWaits) {
  SnapshotAssembler assembler{dictionary()};
  (void)feed(assembler, rounds(0, 20, kBegin));
  auto frames = rounds(20, 3, kBegin + device_time(20));
  // RR_VEL of the first of three rounds.
  frames.erase(std::ranges::find_if(frames, [](const auto& r) { return r.frame.id == 0x122; }));
  const Snapshots snapshots = feed(assembler, frames);
  ASSERT_EQ(snapshots.size(), 3U);
  EXPECT_THAT(snapshots[0].sample.valid, ElementsAre(true, true, false, true));
  EXPECT_TRUE(is_same(snapshots[1].sample, sample_of(21)));
}

TEST(SnapshotAssembler, WithoutItsAnglesALegsRatesAreOfNoOtherRound) {
  SnapshotAssembler assembler{dictionary()};
  (void)feed(assembler, rounds(0, 20, kBegin));
  auto frames = rounds(20, 3, kBegin + device_time(20));
  // FR_POS of the second round: its VEL and TAU must not go to the first one.
  const auto second = frames.begin() + 13;
  frames.erase(
      std::find_if(second, frames.end(), [](const auto& r) { return r.frame.id == 0x110; }));
  const Snapshots snapshots = feed(assembler, frames);
  ASSERT_EQ(snapshots.size(), 3U);
  EXPECT_TRUE(is_same(snapshots[0].sample, sample_of(20)));
  EXPECT_THAT(snapshots[1].sample.valid, ElementsAre(false, true, true, true));
  EXPECT_EQ(snapshots[1].sample.joints[0].dq_radps, 0);
  EXPECT_TRUE(is_same(snapshots[2].sample, sample_of(22)));
  EXPECT_EQ(assembler.counters().late, 2U);
}

TEST(SnapshotAssembler, LostSyncsAreBridgedByTheOnesBefore) {
  SnapshotAssembler assembler{dictionary()};
  // From 83880 rounds on the clock of 24 bits begins again.
  const std::uint64_t first = 83'870;
  const auto lost = [&](const Received& r) {
    return r.frame.id == 0x80 && r.t_arrival > kBegin + milliseconds{15} &&
           r.t_arrival < kBegin + milliseconds{19};
  };
  const Snapshots snapshots = feed(assembler, without(rounds(first, 40, kBegin), lost));
  ASSERT_EQ(snapshots.size(), 40U);
  const Duration wrap = *assembler.stamps().wrap;
  for (std::uint64_t i = 0; i < snapshots.size(); ++i) {
    EXPECT_EQ(snapshots[i].t_device.time_since_epoch(), device_time(first + i) % wrap) << i;
    EXPECT_TRUE(is_same(snapshots[i].sample, sample_of(first + i))) << i;
  }
}

TEST(SnapshotAssembler, LostRoundsAreCountedAsAGap) {
  SnapshotAssembler assembler{dictionary()};
  auto frames = rounds(0, 20, kBegin);
  const auto later = rounds(27, 20, kBegin + device_time(27));
  frames.insert(frames.end(), later.begin(), later.end());
  EXPECT_EQ(feed(assembler, frames).size(), 40U);
  EXPECT_EQ(assembler.counters().gaps, 7U);
  EXPECT_EQ(assembler.counters().restarts, 0U);
}

TEST(SnapshotAssembler, RepeatedAndLateFramesAreCountedAndChangeNothing) {
  SnapshotAssembler assembler{dictionary()};
  (void)feed(assembler, rounds(0, 20, kBegin));
  auto frames = rounds(20, 2, kBegin + device_time(20));
  frames.insert(frames.begin() + 2, frames[1]);  // twice FR_POS
  const auto late = rounds(19, 1, kBegin + device_time(21));
  frames.insert(frames.begin() + 14, late[1]);  // FR_POS of a round that is out
  const Snapshots snapshots = feed(assembler, frames);
  ASSERT_EQ(snapshots.size(), 2U);
  EXPECT_TRUE(is_same(snapshots[0].sample, sample_of(20)));
  EXPECT_TRUE(is_same(snapshots[1].sample, sample_of(21)));
  EXPECT_EQ(assembler.counters().duplicate, 1U);
  EXPECT_EQ(assembler.counters().late, 1U);
}

TEST(SnapshotAssembler, ALegThatIsNotInStepIsRefused) {
  SnapshotAssembler assembler{dictionary()};
  auto frames = rounds(0, 100, kBegin);
  for (Received& received : frames) {
    if (received.frame.id == 0x112) {
      received.frame.data[6] ^= std::byte{0x40};  // RR_seq: 64 rounds ahead or behind
    }
  }
  const Snapshots snapshots = feed(assembler, frames);
  EXPECT_GT(snapshots.size(), 95U);
  for (const auto& snapshot : snapshots) {
    EXPECT_THAT(snapshot.sample.valid, ElementsAre(true, true, false, true));
  }
  EXPECT_GT(assembler.counters().out_of_step, 40U);
}

TEST(SnapshotAssembler, ACounterThatBeginsAnewIsFollowed) {
  for (const auto pause : {milliseconds{0}, milliseconds{400}}) {
    SnapshotAssembler assembler{dictionary()};
    auto frames = rounds(200, 50, kBegin);
    const auto later = rounds(10, 50, kBegin + device_time(50) + pause);
    frames.insert(frames.end(), later.begin(), later.end());
    const Snapshots snapshots = feed(assembler, frames);
    // 250 -> 10 is 16 rounds ahead within 8 bits: without a pause a gap, with one a restart.
    EXPECT_EQ(snapshots.size(), 100U);
    EXPECT_EQ(assembler.counters().restarts, pause.count() > 0 ? 1U : 0U);
    EXPECT_EQ(assembler.counters().gaps, pause.count() > 0 ? 0U : 16U);
  }
  // 150 -> 60 is back by more than SYNCs are repeated.
  SnapshotAssembler assembler{dictionary()};
  auto frames = rounds(100, 50, kBegin);
  const auto later = rounds(60, 50, kBegin + device_time(50));
  frames.insert(frames.end(), later.begin(), later.end());
  EXPECT_EQ(feed(assembler, frames).size(), 100U);
  EXPECT_EQ(assembler.counters().restarts, 1U);
}

TEST(SnapshotAssembler, TheLastRoundsGoOutWhenTheirWaitIsOver) {
  SnapshotAssembler assembler{dictionary()};
  auto frames = rounds(0, 20, kBegin);
  frames.pop_back();
  EXPECT_EQ(feed(assembler, frames).size(), 19U);
  const HostTime t_first = kBegin + device_time(19);
  EXPECT_FALSE(assembler.pop(t_first + milliseconds{19}));
  const auto last = assembler.pop(t_first + milliseconds{20});
  ASSERT_TRUE(last);
  EXPECT_EQ(last->t_device.time_since_epoch(), device_time(19));
}

TEST(SnapshotAssembler, TwoBusesMayOverlap) {
  SnapshotAssembler assembler{dictionary()};
  // Front legs on one bus; the rear ones come over another, 1.5 ms later, with a SYNC of their own.
  auto front = without(rounds(0, 100, kBegin),
                       [](const auto& r) { return r.frame.id > 0x100 && r.frame.id % 16 > 1; });
  const auto rear = without(rounds(0, 100, kBegin + Duration{1'500'000}), [](const auto& r) {
    return r.frame.id > 0x100 && r.frame.id % 16 <= 1;
  });
  front.insert(front.end(), rear.begin(), rear.end());
  std::ranges::stable_sort(front, {}, &Received::t_arrival);
  const Snapshots snapshots = feed(assembler, front);
  ASSERT_EQ(snapshots.size(), 100U);
  for (std::uint64_t i = 0; i < 100; ++i) {
    EXPECT_TRUE(is_same(snapshots[i].sample, sample_of(i))) << i;
    EXPECT_EQ(snapshots[i].t_arrival, kBegin + device_time(i));
  }
}

TEST(SnapshotAssembler, ActuatorsWithoutACounterMakeARoundOfTheirReplies) {
  const auto mit = LegDictionary::load(GEOFLOW_CONFIG_FOLDER "/mit_actuators.dbc");
  ASSERT_TRUE(mit) << mit.error().message;
  SnapshotAssembler assembler{*mit};
  EXPECT_EQ(assembler.stamps().domain, StampDomain::kHost);
  std::vector<Received> replies;
  HostTime t = kBegin;
  for (std::uint64_t round = 0; round < 50; ++round) {
    for (const Frame& reply : LegEncoder{*mit, false}.encode(sample_of(round), round, {})) {
      replies.push_back({.frame = reply, .t_arrival = t});
      t += Duration{160'000};
    }
  }
  replies.erase(replies.begin() + 12 * 30 + 4);  // FL thigh in round 30
  const Snapshots snapshots = feed(assembler, replies);
  ASSERT_EQ(snapshots.size(), 50U);
  for (std::uint64_t i = 0; i < 50; ++i) {
    const auto& [t_device, t_arrival, sample] = snapshots[i];
    EXPECT_EQ(sample.valid[1], i != 30) << i;
    EXPECT_NEAR(sample.joints[11].q_rad, sample_of(i).joints[11].q_rad, 2e-4);
    const HostTime first = kBegin + static_cast<std::int64_t>(12 * i) * Duration{160'000};
    EXPECT_EQ(t_arrival, first);
    EXPECT_EQ(t_device.time_since_epoch(), (first + Duration{880'000}).time_since_epoch());
  }
}

}  // namespace
}  // namespace geoflow::drivers::can
