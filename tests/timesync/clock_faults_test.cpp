#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_fit.hpp"
#include "geoflow/timesync/clock_model.hpp"
#include "geoflow/timesync/wrap.hpp"
#include "tests/support/data.hpp"

#include "clock_run.hpp"
#include "random_clock.hpp"

namespace geoflow::timesync::tests {
namespace {

constexpr double kScaleNs = 0.5 * kMsInNs;
constexpr double kRateHz = 100;

/// A camera-like stream of one clock, fed a sample at a time, with a StreamOrder behind it.
class Stream {
 public:
  explicit Stream(const StampInfo& stamps, double drift = 100e-6)
      : model{stamps}, random_{geoflow::tests::test_seed(7)} {
    clock.drift = drift;
    clock.period_ns = kSecondNs / kRateHz;
    clock.wrap_ns = stamps.wrap ? stamps.wrap->count() : 0;
    clock.offset_ns = 1'000'000'000'000;
  }

  /// The sample of time `t_s`, delayed by random jitter and `extra_ns`.
  Judged feed(double t_s, double extra_ns = 0) {
    const double t_ns = t_s * kSecondNs;
    const auto truth = kHostStartNs + static_cast<std::int64_t>(t_ns);
    const auto delay = static_cast<std::int64_t>(jitter_.draw_ns(random_) + extra_ns);
    const auto sample = model.add(device(clock.stamp_ns(t_ns)), host(truth + delay));
    const HostStamp kept = order_.keep(sample);
    monotone = monotone && kept.t > last_.value_or(HostTime::min());
    last_ = kept.t;
    return {static_cast<double>(count(kept.t) - truth),
            static_cast<double>(kept.error_bound.count())};
  }

  /// Feeds [begin_s, end_s) at the stream's rate; the worst error and whether every bound held.
  Judged feed_all(double begin_s, double end_s) {
    return feed_all(begin_s, end_s, [](double) { return 0.0; });
  }
  /// With a delay of extra_ns(t_s) more.
  Judged feed_all(double begin_s, double end_s, const std::function<double(double)>& extra_ns) {
    Judged worst;
    const auto samples = static_cast<int>(std::lround((end_s - begin_s) * kRateHz));
    for (int i = 0; i < samples; ++i) {
      const double t_s = begin_s + i / kRateHz;
      const Judged one = feed(t_s, extra_ns(t_s));
      worst.error_ns = std::max(worst.error_ns, std::abs(one.error_ns));
      worst.bound_ns = std::max(worst.bound_ns, one.bound_ns);
      covered = covered && std::abs(one.error_ns) <= one.bound_ns;
    }
    return worst;
  }

  Model model;
  RandomClock clock;
  bool monotone = true;
  bool covered = true;

 private:
  Random random_;
  Jitter jitter_ = exponential_jitter(kScaleNs);
  StreamOrder order_;
  std::optional<HostTime> last_;
};

TEST(ClockModel, HostStampsAreTheIdentity) {
  Model model{StampInfo{}};
  EXPECT_TRUE(model.locked());
  for (const std::int64_t ns :
       {std::int64_t{0}, std::int64_t{1'305'031'453'359'684'123}, std::int64_t{-5}}) {
    EXPECT_EQ(model.to_host(device(ns)).t, host(ns));
    const HostStamp stamp = model.add(device(ns), host(77)).stamp;
    EXPECT_EQ(stamp.t, host(ns));
    EXPECT_EQ(stamp.error_bound, Duration::zero());
  }
}

TEST(ClockModel, TheFirstSampleIsUsableWithAWideBound) {
  Model model{kDevice};
  EXPECT_FALSE(model.locked());
  EXPECT_EQ(model.to_host(device(5)).error_bound, Duration::max());
  const HostStamp first = model.add(device(123'000), host(kHostStartNs)).stamp;
  EXPECT_EQ(first.t, host(kHostStartNs));
  EXPECT_GE(first.error_bound, ClockFitConfig{}.first_bound);
  EXPECT_LE(first.error_bound, 2 * ClockFitConfig{}.first_bound);
  EXPECT_EQ(model.to_host(device(123'000 + 1'000'000)).t, host(kHostStartNs + 1'000'000));
}

TEST(ClockModel, AKnownLeastDelayIsTakenOff) {
  Model model{kDevice, {.min_delay = std::chrono::milliseconds{3}}};
  EXPECT_EQ(model.add(device(0), host(kHostStartNs)).stamp.t, host(kHostStartNs - 3'000'000));
}

TEST(ClockModel, NothingIsPlacedAfterItsArrival) {
  Model model{kDevice};
  (void)model.add(device(0), host(kHostStartNs));
  const auto early = model.add(device(50'000'000), host(kHostStartNs + 20'000'000)).stamp;
  EXPECT_LE(early.t, host(kHostStartNs + 20'000'000));
}

TEST(ClockModel, AWrapIsNoEvent) {
  Stream stream{kWrapping};
  stream.clock.offset_ns = kWrap32Us - 20'000'000'000;  // wraps after 20 s
  stream.feed_all(0, 5);
  EXPECT_LE(stream.feed_all(5, 40).error_ns, 0.5 * kScaleNs);
  EXPECT_TRUE(stream.monotone);
  EXPECT_EQ(stream.model.counters().jumps, 0U);
  EXPECT_LT(stream.model.counters().outliers, 10U);  // the tail of the jitter
}

TEST(ClockModel, ASilenceLongerThanHalfAWrapIsNoEventEither) {
  Stream stream{kWrapping};
  stream.feed_all(0, 60);
  constexpr double kGapS = 3600;  // of 4295
  const Judged after = stream.feed(60 + kGapS);
  EXPECT_LE(std::abs(after.error_ns), after.bound_ns);
  EXPECT_EQ(stream.model.counters().jumps, 0U);
  EXPECT_TRUE(stream.monotone);
}

TEST(ClockModel, JumpsAndRestartsAreCountedAndLockedAgain) {
  constexpr std::int64_t kMs = 1'000'000;
  for (const std::int64_t jump_ns : {30 * kMs, -30 * kMs, 500 * kMs, -500 * kMs, 10'000 * kMs,
                                     -10'000 * kMs, 3'000'000 * kMs, -1'000'000 * kMs}) {
    Stream stream{kDevice};
    stream.feed_all(0, 30);
    stream.clock.offset_ns += jump_ns;
    stream.feed_all(30, 32);  // detection takes up to a second
    EXPECT_EQ(stream.model.counters().jumps, 1U) << jump_ns;
    const Judged after = stream.feed_all(32, 60);
    EXPECT_LE(after.error_ns, kScaleNs) << jump_ns;
    // A count that went back by less than a believable delay could have been overtaken: it is
    // placed in its order.
    const bool could_be_late = jump_ns < 0 && -jump_ns < ClockFitConfig{}.max_delay.count();
    EXPECT_TRUE(stream.monotone || could_be_late) << jump_ns;
    EXPECT_EQ(stream.model.counters().jumps, 1U) << jump_ns;
  }
}

TEST(ClockModel, SamplesOfAForwardJumpArePlacedByTheirArrivalMeanwhile) {
  Stream stream{kDevice};
  stream.feed_all(0, 30);
  stream.clock.offset_ns += 10'000'000'000;
  const Judged during = stream.feed_all(30, 30.15);
  EXPECT_EQ(stream.model.counters().jumps, 0U);
  EXPECT_LE(during.error_ns, 20 * kScaleNs);
  EXPECT_TRUE(stream.covered);
}

TEST(ClockModel, ABurstAfterStalledDeliveryIsNoJump) {
  for (const double stall_s : {0.1, 0.5, 1.5}) {
    Stream stream{kDevice};
    stream.feed_all(0, 30);
    const Judged during = stream.feed_all(
        30, 30 + stall_s, [stall_s](double t_s) { return (30 + stall_s - t_s) * kSecondNs; });
    EXPECT_LE(during.error_ns, 0.5 * kScaleNs) << stall_s;
    EXPECT_LE(stream.feed_all(30 + stall_s, 60).error_ns, 0.5 * kScaleNs) << stall_s;
    EXPECT_EQ(stream.model.counters().jumps, 0U) << stall_s;
    EXPECT_GT(stream.model.counters().outliers, 0U) << stall_s;
    EXPECT_TRUE(stream.monotone) << stall_s;
    EXPECT_TRUE(stream.covered) << stall_s;
  }
}

TEST(ClockModel, ABurstAtTheVeryBeginningIsOutgrown) {
  Stream stream{kDevice};
  stream.feed_all(0, 0.8, [](double t_s) { return (0.8 - t_s) * kSecondNs; });
  stream.feed_all(0.8, 8);
  EXPECT_LE(stream.feed_all(8, 30).error_ns, 0.5 * kScaleNs);
}

TEST(ClockModel, SingleWrongStampsTouchNothing) {
  Stream stream{kDevice};
  stream.feed_all(0, 30);
  const std::int64_t offset_ns = stream.clock.offset_ns;
  double worst_ns = 0;
  for (int i = 0; i < 3000; ++i) {
    const bool wrong = i % 50 == 7;
    stream.clock.offset_ns = offset_ns + (wrong ? (i % 100 == 7 ? 1 : -1) * 700'000'000 : 0);
    const double error_ns = std::abs(stream.feed(30 + i / kRateHz).error_ns);
    worst_ns = wrong ? worst_ns : std::max(worst_ns, error_ns);
  }
  EXPECT_LE(worst_ns, 0.5 * kScaleNs);
  EXPECT_GE(stream.model.counters().outliers, 60U);
  EXPECT_LE(stream.model.counters().outliers, 70U);  // the tail of the jitter
  EXPECT_EQ(stream.model.counters().jumps, 0U);
}

TEST(ClockModel, AStuckCountIsNoJump) {
  Model model{kDevice};
  for (int i = 0; i < 1000; ++i) {
    (void)model.add(device(i * 10'000'000LL), host(kHostStartNs + i * 10'000'000LL));
  }
  for (int i = 1000; i < 2000; ++i) {
    const HostStamp stamp =
        model.add(device(999 * 10'000'000LL), host(kHostStartNs + i * 10'000'000LL)).stamp;
    EXPECT_TRUE(stamp.t == host(kHostStartNs + 999 * 10'000'000LL) || i > 1199) << i;
  }
  EXPECT_EQ(model.counters().jumps, 0U);
}

TEST(ClockModel, FollowsAWanderingOscillator) {
  Stream stream{kDevice, 0};
  double phase_ns = 0;
  const std::int64_t offset_ns = stream.clock.offset_ns;
  double worst_ns = 0;
  for (int i = 0; i < 60'000; ++i) {  // 10 min; the rate swings by +-5 ppm with a period of 5 min
    phase_ns += 5e-6 * std::sin(2 * std::numbers::pi * i / 30'000) * kSecondNs / kRateHz;
    stream.clock.offset_ns = offset_ns + static_cast<std::int64_t>(phase_ns);
    const double error_ns = std::abs(stream.feed(i / kRateHz).error_ns);
    worst_ns = i < 500 ? 0.0 : std::max(worst_ns, error_ns);
  }
  EXPECT_LE(worst_ns, 0.5 * kScaleNs);
  EXPECT_TRUE(stream.covered);
  EXPECT_EQ(stream.model.counters().jumps, 0U);
}

RC_GTEST_PROP(ClockModel, AnyNumbersAreSurvived, ()) {
  const auto pairs = *rc::gen::arbitrary<std::vector<std::pair<std::int64_t, std::int64_t>>>();
  const bool wraps = *rc::gen::arbitrary<bool>();
  Model model{wraps ? kWrapping : kDevice};
  StreamOrder order;
  for (const auto& [raw, arrival] : pairs) {
    const std::int64_t shift = *rc::gen::inRange(0, 62);
    const auto sample = model.add(device(raw >> shift), host(arrival >> shift));
    if (is_plausible_stamp_ns(count(sample.stamp.t))) {
      RC_ASSERT(order.keep(sample).error_bound >= Duration::zero());
    }
    RC_ASSERT(model.to_host(device(raw)).error_bound >= Duration::zero());
  }
}

/// Device counts in any order: placed in the same order, equal ones at the same instant.
RC_GTEST_PROP(StreamOrder, KeepsTheDevicesOrderAgainstTheNewest, ()) {
  Random random{*rc::gen::arbitrary<std::uint64_t>()};
  const Jitter jitter = exponential_jitter(kScaleNs);
  Model model{kDevice};
  StreamOrder order;
  std::int64_t newest_device = -1;
  HostTime newest = HostTime::min();
  for (std::int64_t i = 0; i < 300; ++i) {
    const std::int64_t back = *rc::gen::inRange<std::int64_t>(0, 3);
    const std::int64_t device_ns = std::max<std::int64_t>(i - back, 0) * 2'000'000;
    const auto arrival =
        kHostStartNs + i * 2'000'000 + static_cast<std::int64_t>(jitter.draw_ns(random));
    const HostTime t = order.keep(model.add(device(device_ns), host(arrival))).t;
    if (device_ns > newest_device) {
      RC_ASSERT(t > newest);
    } else if (device_ns == newest_device) {
      RC_ASSERT(t == newest);
    } else {
      RC_ASSERT(t < newest);
    }
    newest = device_ns >= newest_device ? t : newest;
    newest_device = std::max(device_ns, newest_device);
  }
}

TEST(Unwrap, FindsTheNearestCongruentValue) {
  EXPECT_EQ(unwrap_ns(5, 100, 0), 5);
  EXPECT_EQ(unwrap_ns(5, 100, 98), 105);
  EXPECT_EQ(unwrap_ns(95, 100, 3), -5);
  EXPECT_EQ(unwrap_ns(95, 100, 1003), 995);
  EXPECT_EQ(unwrap_ns(95, 100, -203), -205);
}

}  // namespace
}  // namespace geoflow::timesync::tests
