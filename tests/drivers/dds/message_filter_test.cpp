#include "dds/message_filter.hpp"

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/low_state.hpp"
#include "dds/low_state_fixture.hpp"

namespace geoflow::drivers::dds {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;
using tests::low_state;

class MessageFilterTest : public testing::Test {
 protected:
  MessageFilterTest() { filter_.opened(now_); }

  std::optional<RobotSample> take(const LowState& state) {
    return filter_.take(encode(state), now_);
  }
  /// Messages as the robot sends them, every 2 ms.
  void run(std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      now_ += milliseconds{2};
      ASSERT_TRUE(take(low_state(first + i)));
    }
  }
  MessageFilter::Report report() { return filter_.assess(now_, 1); }

  MessageFilter filter_{"rt/lowstate on eth0, domain 0"};
  HostTime now_{std::chrono::seconds{100}};
};

TEST_F(MessageFilterTest, MessagesBecomeSamplesOnTheRobotsClock) {
  const auto sample = take(low_state(500));
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->legs.t_device.time_since_epoch(), milliseconds{1000});
  EXPECT_EQ(sample->imu.t_device.time_since_epoch(), milliseconds{1000});
  EXPECT_EQ(sample->legs.t_arrival, now_);
  EXPECT_EQ(report().state, SourceState::kStreaming);
  run(501, 1000);
  EXPECT_EQ(filter_.counters().accepted, 1001U);
  EXPECT_EQ(filter_.counters().lost + filter_.counters().duplicates, 0U);
  EXPECT_EQ(report().reason, "");
}

TEST_F(MessageFilterTest, SilenceIsSeenAfter100Milliseconds) {
  now_ += milliseconds{100};
  EXPECT_EQ(report().state, SourceState::kStreaming);
  now_ += milliseconds{1};
  EXPECT_EQ(report().state, SourceState::kFailed);
  EXPECT_THAT(report().reason,
              HasSubstr("rt/lowstate on eth0, domain 0: the robot is there, but sends nothing"));
  EXPECT_THAT(filter_.assess(now_, 0).reason, HasSubstr("no robot sends it. Is it on"));
  run(0, 10);
  EXPECT_EQ(report().state, SourceState::kStreaming);
  now_ += milliseconds{101};
  EXPECT_EQ(report().state, SourceState::kFailed);
}

TEST_F(MessageFilterTest, LostMessagesAreCountedByTheTick) {
  run(0, 100);
  run(117, 1);
  EXPECT_EQ(filter_.counters().lost, 17U);
  EXPECT_EQ(report().state, SourceState::kDegraded);
  EXPECT_THAT(report().reason, HasSubstr("17 messages were lost"));
  run(118, 501);  // it is said for a second
  EXPECT_EQ(report().state, SourceState::kStreaming);
  EXPECT_EQ(filter_.counters().lost, 17U);
}

TEST_F(MessageFilterTest, TheTicksJitterIsNoGap) {
  LowState state = low_state(0);
  for (std::uint32_t i = 0; i < 300; ++i) {
    now_ += milliseconds{2};
    state = low_state(i);
    state.tick = 2 * i + i % 2;  // steps of 1 and 3 ms
    state.crc = checksum(state);
    ASSERT_TRUE(take(state));
  }
  EXPECT_EQ(filter_.counters().lost, 0U);
}

TEST_F(MessageFilterTest, DuplicatesAreDropped) {
  run(0, 10);
  EXPECT_FALSE(take(low_state(9)));  // the same message again
  LowState same_values = low_state(9);
  same_values.tick += 2;
  same_values.crc = checksum(same_values);
  EXPECT_FALSE(take(same_values));  // stale values under a new tick
  LowState same_tick = low_state(10);
  same_tick.tick = same_values.tick;
  same_tick.crc = checksum(same_tick);
  EXPECT_FALSE(take(same_tick));
  EXPECT_EQ(filter_.counters().duplicates, 3U);
  EXPECT_TRUE(take(low_state(11)));
}

TEST_F(MessageFilterTest, ARobotThatStandsPerfectlyStillIsHeardAgainSoon) {
  run(0, 10);
  LowState still = low_state(9);
  std::uint32_t dropped = 0;
  for (int i = 0; i < 100; ++i) {
    now_ += milliseconds{2};
    still.tick += 2;
    still.crc = checksum(still);
    dropped += take(still) ? 0U : 1U;
  }
  EXPECT_EQ(dropped, 25U);  // 50 ms
  EXPECT_EQ(report().state, SourceState::kStreaming);
}

TEST_F(MessageFilterTest, DamagedMessagesOfASenderWithRightChecksumsAreDropped) {
  run(0, 10);
  LowState damaged = low_state(10);
  damaged.motor_state[3].q += 1;
  EXPECT_FALSE(take(damaged));
  EXPECT_EQ(filter_.counters().damaged, 1U);
  EXPECT_EQ(report().state, SourceState::kDegraded);
  EXPECT_THAT(report().reason, HasSubstr("wrong checksum"));
}

TEST_F(MessageFilterTest, ASenderWhoseChecksumsNeverWereRightIsBelieved) {
  for (std::uint32_t i = 0; i < 10; ++i) {
    now_ += milliseconds{2};
    LowState state = low_state(i);
    state.crc ^= 0xFFU;
    EXPECT_TRUE(take(state));
  }
  EXPECT_EQ(filter_.counters().unchecked, 10U);
  EXPECT_EQ(report().state, SourceState::kStreaming);
}

TEST_F(MessageFilterTest, WrongLengthsAndWhatIsNoNumberAreRefusedAndSaid) {
  run(0, 10);
  auto bytes = encode(low_state(10));
  bytes.resize(700);
  EXPECT_FALSE(filter_.take(bytes, now_));
  EXPECT_EQ(report().state, SourceState::kDegraded);
  EXPECT_THAT(report().reason, HasSubstr("ends at byte 700"));
  LowState state = low_state(10);
  state.imu_state.accelerometer[0] = std::numeric_limits<float>::quiet_NaN();
  state.crc = checksum(state);
  EXPECT_FALSE(take(state));
  EXPECT_EQ(filter_.counters().malformed, 2U);
  // Nothing else comes: the reason is what was wrong with it.
  now_ += milliseconds{101};
  EXPECT_EQ(report().state, SourceState::kFailed);
  EXPECT_THAT(report().reason, HasSubstr("the IMU has a value that is no number"));
}

TEST_F(MessageFilterTest, TheClockMayWrapOrBeginAnew) {
  LowState state = low_state(1);
  state.tick = std::numeric_limits<std::uint32_t>::max() - 1;
  state.crc = checksum(state);
  ASSERT_TRUE(take(state));
  run(0, 10);
  EXPECT_EQ(filter_.counters().restarts, 0U);
  EXPECT_EQ(filter_.counters().lost, 0U);
  run(1000, 10);
  run(3, 10);
  EXPECT_EQ(filter_.counters().restarts, 1U);
  EXPECT_EQ(report().state, SourceState::kDegraded);
  EXPECT_THAT(report().reason, HasSubstr("clock has begun anew"));
}

TEST_F(MessageFilterTest, WhatCannotBeOpenedIsSaidAsItIs) {
  filter_.failed({.code = ErrorCode::kNotFound, .message = "eth7: no such network interface"});
  EXPECT_EQ(report().state, SourceState::kFailed);
  EXPECT_EQ(report().reason, "eth7: no such network interface");
}

}  // namespace
}  // namespace geoflow::drivers::dds
