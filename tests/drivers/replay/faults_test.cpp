#include "geoflow/drivers/faults.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/faults/reader.hpp"
#include "replay/faults/script.hpp"
#include "replay/fixtures.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using std::chrono::milliseconds;
using tests::at_ms;
using tests::message_of;

constexpr std::int64_t kStart_ms = 5000;
constexpr int kSamples = 1000;
constexpr int kPeriod_ms = 10;

/// 1000 of each: colour, depth (1 ms later), IMU (2 ms later), legs (3 ms), body velocity (4 ms),
/// at 100 Hz.
class ScriptedReader final : public RecordingReader {
 public:
  ScriptedReader() {
    info_.start = at_ms(kStart_ms);
    info_.end = at_ms(kStart_ms + std::int64_t{kSamples} * kPeriod_ms);
  }
  [[nodiscard]] const RecordingInfo& info() const override { return info_; }
  [[nodiscard]] Result<std::optional<Event>> next() override {
    if (index_ == kSamples * static_cast<int>(kStreamCount)) {
      return std::nullopt;
    }
    const int round = index_ / static_cast<int>(kStreamCount);
    const auto stream = static_cast<StreamId>(index_ % static_cast<int>(kStreamCount));
    ++index_;
    return make(stream, round);
  }

 private:
  static Event make(StreamId stream, int round) {
    const auto since_epoch =
        milliseconds{kStart_ms + std::int64_t{round} * kPeriod_ms + static_cast<int>(stream)};
    const HostTime arrival{since_epoch};
    switch (stream) {
      case StreamId::kColor:
      case StreamId::kDepth:
        return Arrival<CameraClock, EncodedImage>{
            DeviceTime<CameraClock>{since_epoch},
            arrival,
            {.stream = stream == StreamId::kColor ? ImageStream::kColor : ImageStream::kDepth,
             .bytes = std::vector<std::byte>(100, static_cast<std::byte>(round))}};
      case StreamId::kImu:
        return Arrival<ImuClock, ImuSample>{
            DeviceTime<ImuClock>{since_epoch}, arrival, {.accel_mps2 = Vector3d::Constant(round)}};
      case StreamId::kLegs: {
        LegSample legs;
        legs.joints[0].q_rad = round;
        return Arrival<LegClock, LegSample>{DeviceTime<LegClock>{since_epoch}, arrival, legs};
      }
      case StreamId::kBodyVelocity:
        break;
    }
    return Arrival<LegClock, BodyVelocitySample>{
        DeviceTime<LegClock>{since_epoch}, arrival, {.v_base_mps = Vector3d::Constant(round)}};
  }

  RecordingInfo info_;
  int index_ = 0;
};

struct Outcome {
  std::vector<Event> events;
  FaultCounters counters;
  RecordingStamps stamps;

  template <typename T>
  [[nodiscard]] std::vector<T> of() const {
    std::vector<T> found;
    for (const Event& event : events) {
      if (const T* typed = std::get_if<T>(&event)) {
        found.push_back(*typed);
      }
    }
    return found;
  }
  [[nodiscard]] std::uint64_t count(StreamId stream) const {
    return static_cast<std::uint64_t>(std::ranges::count(events, stream, stream_of));
  }
  /// Of all kinds and streams.
  [[nodiscard]] std::uint64_t total() const {
    std::uint64_t sum = 0;
    for (const auto& streams : counters.counts) {
      for (const std::uint64_t value : streams) {
        sum += value;
      }
    }
    return sum;
  }
};

using ImuArrival = Arrival<ImuClock, ImuSample>;
using ImageArrival = Arrival<CameraClock, EncodedImage>;

Outcome run(std::string_view script, std::uint64_t seed = 1) {
  auto faults = faults::parse_script("script.toml", script);
  EXPECT_TRUE(faults) << message_of(faults);
  const auto reader = faults::with_faults(std::make_unique<ScriptedReader>(),
                                          faults.value_or(std::vector<faults::Fault>{}), seed);
  Outcome outcome;
  outcome.stamps = reader->stamps();
  for (auto event = reader->next(); event && *event; event = reader->next()) {
    outcome.events.push_back(**std::move(event));
  }
  outcome.counters = *reader->faults();
  EXPECT_TRUE(std::ranges::is_sorted(outcome.events, {}, arrival_of));
  return outcome;
}

TEST(Faults, NoneLeaveAllAsItIs) {
  const Outcome clean = run("");
  EXPECT_EQ(clean.events.size(), kSamples * kStreamCount);
  EXPECT_EQ(clean.total(), 0U);
  EXPECT_EQ(clean.stamps.camera.domain, StampDomain::kHost);
}

TEST(Faults, DropTakesItsShareOfItsStreamOnly) {
  const Outcome faulty = run("[[fault]]\nkind = 'drop'\nstream = 'color'\nprobability = 0.2\n");
  const auto dropped = faulty.counters.of(FaultKind::kDrop, StreamId::kColor);
  // Five standard deviations of a binomial of 1000 at 0.2.
  EXPECT_NEAR(static_cast<double>(dropped), 200, 5 * std::sqrt(1000 * 0.2 * 0.8));
  EXPECT_EQ(faulty.count(StreamId::kColor) + dropped, static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(faulty.count(StreamId::kDepth), static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(faulty.total(), dropped);
}

TEST(Faults, CameraMeansColorAndDepth) {
  const Outcome faulty = run("[[fault]]\nkind = 'drop'\nstream = 'camera'\n");
  EXPECT_EQ(faulty.count(StreamId::kColor), 0U);
  EXPECT_EQ(faulty.count(StreamId::kDepth), 0U);
  EXPECT_EQ(faulty.count(StreamId::kImu), static_cast<std::uint64_t>(kSamples));
}

TEST(Faults, GapSilencesAWindow) {
  const Outcome faulty = run("[[fault]]\nkind = 'gap'\nstream = 'imu'\nfrom_s = 2\nuntil_s = 3\n");
  EXPECT_EQ(faulty.counters.of(FaultKind::kGap, StreamId::kImu), 100U);
  for (const ImuArrival& imu : faulty.of<ImuArrival>()) {
    EXPECT_TRUE(imu.t_arrival < at_ms(kStart_ms + 2000) ||
                imu.t_arrival >= at_ms(kStart_ms + 3000));
  }
}

TEST(Faults, DelayMovesArrivalAndKeepsTheStamp) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'delay'\nstream = 'depth'\ndelay_s = 0.05\njitter_s = "
          "0.1\nprobability = 0.5\n");
  std::uint64_t late = 0;
  for (const ImageArrival& image : faulty.of<ImageArrival>()) {
    const Duration delay = image.t_arrival.time_since_epoch() - image.t_device.time_since_epoch();
    EXPECT_TRUE(delay == Duration{} || (delay >= milliseconds{50} && delay < milliseconds{150}));
    late += delay > Duration{} ? 1U : 0U;
  }
  EXPECT_EQ(late, faulty.counters.of(FaultKind::kDelay, StreamId::kDepth));
  EXPECT_NEAR(static_cast<double>(late), 500, 5 * std::sqrt(250.0));
  EXPECT_EQ(faulty.count(StreamId::kDepth), static_cast<std::uint64_t>(kSamples));
}

TEST(Faults, DuplicateRepeatsTheSample) {
  const Outcome faulty = run("[[fault]]\nkind = 'duplicate'\nstream = 'legs'\nuntil_s = 1\n");
  EXPECT_EQ(faulty.counters.of(FaultKind::kDuplicate, StreamId::kLegs), 100U);
  const auto legs = faulty.of<Arrival<LegClock, LegSample>>();
  ASSERT_EQ(legs.size(), static_cast<std::size_t>(kSamples) + 100);
  EXPECT_EQ(legs[0].t_device, legs[1].t_device);
  EXPECT_EQ(legs[0].sample.joints[0].q_rad, legs[1].sample.joints[0].q_rad);
}

TEST(Faults, ReorderSwapsNeighbours) {
  const Outcome faulty = run("[[fault]]\nkind = 'reorder'\nstream = 'imu'\nprobability = 0.3\n");
  const auto imus = faulty.of<ImuArrival>();
  ASSERT_EQ(imus.size(), static_cast<std::size_t>(kSamples));
  std::uint64_t swaps = 0;
  for (std::size_t i = 1; i < imus.size(); ++i) {
    if (imus[i].t_device < imus[i - 1].t_device) {
      EXPECT_EQ(imus[i - 1].t_device - imus[i].t_device, milliseconds{kPeriod_ms});
      ++swaps;
    }
  }
  EXPECT_GT(swaps, 100U);
  EXPECT_EQ(swaps, faulty.counters.of(FaultKind::kReorder, StreamId::kImu));
}

TEST(Faults, ReorderKeepsTheLastSample) {
  const Outcome faulty = run("[[fault]]\nkind = 'reorder'\nstream = 'imu'\nfrom_s = 9.99\n");
  EXPECT_EQ(faulty.count(StreamId::kImu), static_cast<std::uint64_t>(kSamples));
}

TEST(Faults, StuckRepeatsTheLastGoodValueUnderNewStamps) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'stuck'\nstream = 'imu'\nfrom_s = 1\nuntil_s = 2\n");
  EXPECT_EQ(faulty.counters.of(FaultKind::kStuck, StreamId::kImu), 100U);
  const auto imus = faulty.of<ImuArrival>();
  EXPECT_EQ(imus[99].sample.accel_mps2.x(), 99);
  for (std::size_t i = 100; i < 200; ++i) {
    EXPECT_EQ(imus[i].sample.accel_mps2.x(), 99);
    EXPECT_GT(imus[i].t_device, imus[i - 1].t_device);
  }
  EXPECT_EQ(imus[200].sample.accel_mps2.x(), 200);
}

TEST(Faults, NanPoisonsNumbers) {
  for (const char* stream : {"imu", "legs", "body_velocity"}) {
    const Outcome faulty =
        run(fmt::format("[[fault]]\nkind = 'nan'\nstream = '{}'\nuntil_s = 0.1\n", stream));
    std::size_t bad = 0;
    for (const auto& imu : faulty.of<ImuArrival>()) {
      bad += imu.sample.accel_mps2.hasNaN() && imu.sample.gyro_radps.hasNaN() ? 1U : 0U;
    }
    for (const auto& legs : faulty.of<Arrival<LegClock, LegSample>>()) {
      bad += std::isnan(legs.sample.joints[11].q_rad) ? 1U : 0U;
    }
    for (const auto& velocity : faulty.of<Arrival<LegClock, BodyVelocitySample>>()) {
      bad += velocity.sample.v_base_mps.hasNaN() ? 1U : 0U;
    }
    EXPECT_EQ(bad, 10U) << stream;
    EXPECT_EQ(faulty.total(), 10U) << stream;
  }
}

TEST(Faults, TruncateCutsTheEncodedImage) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'truncate'\nstream = 'color'\nkeep = 0.25\nuntil_s = 0.5\n");
  EXPECT_EQ(faulty.counters.of(FaultKind::kTruncate, StreamId::kColor), 50U);
  const auto images = faulty.of<ImageArrival>();
  EXPECT_EQ(images[0].sample.bytes.size(), 25U);
  EXPECT_EQ(images[1].sample.bytes.size(), 100U);
  EXPECT_EQ(images[100].sample.bytes.size(), 100U);
}

/// Device time minus true time of the IMU sample `index`.
Duration clock_error(const Outcome& faulty, std::size_t index) {
  const ImuArrival imu = faulty.of<ImuArrival>().at(index);
  return imu.t_device.time_since_epoch() - imu.t_arrival.time_since_epoch();
}

TEST(Faults, ClockOffsetShiftsStampsButNotArrivals) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'clock_offset'\nstream = 'imu'\noffset_s = -0.25\n");
  EXPECT_EQ(clock_error(faulty, 0), milliseconds{-250});
  EXPECT_EQ(clock_error(faulty, 999), milliseconds{-250});
  EXPECT_EQ(faulty.counters.of(FaultKind::kClockOffset, StreamId::kImu),
            static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(faulty.stamps.imu.domain, StampDomain::kDevice);
  EXPECT_EQ(faulty.stamps.imu.wrap, std::nullopt);
  EXPECT_EQ(faulty.stamps.camera.domain, StampDomain::kHost);
  EXPECT_EQ(faulty.stamps.legs.domain, StampDomain::kHost);
}

TEST(Faults, ClockDriftGrowsWithTime) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'clock_drift'\nstream = 'imu'\ndrift_ppm = 100\nfrom_s = 1\nuntil_s = "
          "6\n");
  EXPECT_EQ(clock_error(faulty, 50), Duration{});
  EXPECT_EQ(clock_error(faulty, 300), std::chrono::nanoseconds{200200});  // 100 ppm of 2.002 s
  EXPECT_EQ(clock_error(faulty, 999), std::chrono::microseconds{500});
}

TEST(Faults, ClockJumpStepsOnceAndStays) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'clock_jump'\nstream = 'imu'\njump_s = 2.5\nfrom_s = 4\n");
  EXPECT_EQ(clock_error(faulty, 399), Duration{});
  EXPECT_EQ(clock_error(faulty, 400), milliseconds{2500});
  EXPECT_EQ(clock_error(faulty, 999), milliseconds{2500});
  EXPECT_EQ(faulty.counters.of(FaultKind::kClockJump, StreamId::kImu), 600U);
}

TEST(Faults, ClockWrapIsA32BitCounterOfMicroseconds) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'clock_wrap'\nstream = 'camera'\nfirst_wrap_s = 3\n");
  constexpr Duration kPeriod = std::chrono::microseconds{std::int64_t{1} << 32U};
  EXPECT_EQ(faulty.stamps.camera.domain, StampDomain::kDevice);
  EXPECT_EQ(faulty.stamps.camera.wrap, kPeriod);
  EXPECT_EQ(faulty.counters.of(FaultKind::kClockWrap, StreamId::kColor), 1U);
  EXPECT_EQ(faulty.counters.of(FaultKind::kClockWrap, StreamId::kDepth), 0U);
  const auto images = faulty.of<ImageArrival>();
  EXPECT_EQ(images[0].t_device.time_since_epoch(), kPeriod - std::chrono::seconds{3});
  EXPECT_EQ(images[600].t_device.time_since_epoch(), Duration{});
  EXPECT_EQ(images[601].t_device.time_since_epoch(), milliseconds{1});
  EXPECT_EQ(images[0].t_arrival, at_ms(kStart_ms));
}

TEST(Faults, AWrapComesBehindTheOtherFaultsOfItsClock) {
  const Outcome faulty =
      run("[[fault]]\nkind = 'clock_wrap'\nstream = 'imu'\nfirst_wrap_s = 3\n"
          "[[fault]]\nkind = 'clock_jump'\nstream = 'imu'\njump_s = 5000\nfrom_s = 1\n");
  for (const ImuArrival& imu : faulty.of<ImuArrival>()) {
    EXPECT_LT(imu.t_device.time_since_epoch(), std::chrono::microseconds{std::int64_t{1} << 32U});
  }
  EXPECT_GE(faulty.counters.of(FaultKind::kClockWrap, StreamId::kImu), 1U);
}

TEST(Faults, LegsClockIsTheBodyVelocitysToo) {
  const Outcome faulty = run("[[fault]]\nkind = 'clock_offset'\nstream = 'legs'\noffset_s = 1\n");
  EXPECT_EQ(faulty.counters.of(FaultKind::kClockOffset, StreamId::kBodyVelocity),
            static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(faulty.stamps.legs.domain, StampDomain::kDevice);
}

constexpr const char* kMixed =
    "[[fault]]\nkind = 'drop'\nstream = 'camera'\nprobability = 0.2\n"
    "[[fault]]\nkind = 'delay'\nstream = 'imu'\ndelay_s = 0.02\njitter_s = 0.02\nprobability = "
    "0.1\n"
    "[[fault]]\nkind = 'reorder'\nstream = 'depth'\nprobability = 0.1\n";

std::string trace(const Outcome& outcome) {
  std::string text;
  for (const Event& event : outcome.events) {
    text +=
        fmt::format("{}@{} ", name(stream_of(event)), arrival_of(event).time_since_epoch().count());
  }
  return text;
}

TEST(Faults, AreDeterministicBySeed) {
  EXPECT_EQ(trace(run(kMixed, 7)), trace(run(kMixed, 7)));
  EXPECT_NE(trace(run(kMixed, 7)), trace(run(kMixed, 8)));
  EXPECT_NE(trace(run(kMixed, 7)), trace(run(kMixed, 7 + (std::uint64_t{1} << 32U))));
}

}  // namespace
}  // namespace geoflow::drivers
