#include "geoflow/timesync/synchroniser.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

#include "scripted_streams.hpp"

namespace geoflow::timesync::tests {
namespace {

using ::testing::DoubleEq;
using ::testing::Pointwise;

constexpr SynchroniserStreams kCameraOnly{};
constexpr SynchroniserStreams kWithImu{.imu = StampInfo{}};
constexpr SynchroniserStreams kAll{.imu = StampInfo{}, .legs = StampInfo{}};

TEST(Synchroniser, PairsColourWithDepthOfTheSameInstantAtOnce) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_color(color(100));
  EXPECT_TRUE(pop_all(sync, 100).empty()) << "depth has not come yet";
  const auto frame = depth(100);
  sync.push_depth(frame);
  const auto packets = pop_all(sync, 100);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0].t, host_ms(100));
  EXPECT_EQ(packets[0].sequence, 0U);
  EXPECT_EQ(packets[0].error_bound, Duration::zero());
  EXPECT_EQ(packets[0].depth.bytes().data(), frame.sample.image.bytes().data());
  EXPECT_EQ(packets[0].depth_offset, Duration::zero());
  EXPECT_EQ(sync.counters().packets, 1U);
}

TEST(Synchroniser, HostStampsPassThroughToTheNanosecond) {
  Synchroniser sync{{}, kCameraOnly};
  const DeviceTime<CameraClock> t{Duration{1'305'031'453'359'684'123}};
  sync.push_color({t, HostTime{t.time_since_epoch()}, ColorFrame{tiny_frame()}});
  const auto packet = sync.flush();
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->t.time_since_epoch(), t.time_since_epoch());
}

TEST(Synchroniser, TakesTheNearerDepthAndReportsItsOffset) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_depth(depth(88));
  sync.push_color(color(100));
  sync.push_depth(depth(105));
  const auto packets = pop_all(sync, 105);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0].depth_offset, from_ms(5));
  EXPECT_EQ(packets[0].t_arrival, host_ms(105));
}

TEST(Synchroniser, LeavesDepthEmptyBeyondTheTolerance) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_depth(depth(79.9));
  sync.push_color(color(100));
  sync.push_depth(depth(120.1));
  const auto packets = pop_all(sync, 121);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_FALSE(packets[0].depth);
  EXPECT_EQ(sync.counters().depth_missing, 1U);
  EXPECT_EQ(sync.counters().depth.unused, 1U);
}

TEST(Synchroniser, OneLostDepthFrameDoesNotShiftTheLaterPairs) {
  Synchroniser sync{{}, kCameraOnly};
  std::vector<SyncedPacket> packets;
  for (int i = 0; i < 10; ++i) {
    const double t = 100 + 30 * i;
    sync.push_color(color(t));
    if (i != 4) {
      sync.push_depth(depth(t + 12));
    }
    for (auto& packet : pop_all(sync, t + 12)) {
      packets.push_back(packet);
    }
  }
  for (auto& packet : flush_all(sync)) {
    packets.push_back(packet);
  }
  ASSERT_EQ(packets.size(), 10U);
  for (int i = 0; i < 10; ++i) {
    const double expected_ms = i == 4 ? -18 : 12;  // frame 4 is lent the depth of frame 3
    EXPECT_EQ(packets[static_cast<std::size_t>(i)].depth_offset, from_ms(expected_ms)) << i;
  }
  EXPECT_EQ(sync.counters().depth_shared, 1U);
}

TEST(Synchroniser, DoesNotShareDepthWhenToldNotTo) {
  Synchroniser sync{{.share_depth = false}, kCameraOnly};
  sync.push_color(color(100));
  sync.push_depth(depth(105));
  sync.push_color(color(116));
  sync.push_depth(depth(150));
  const auto packets = pop_all(sync, 150);
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_TRUE(packets[0].depth);
  EXPECT_FALSE(packets[1].depth);
}

TEST(Synchroniser, WindowsHoldTheIntervalAndOneSampleEachSide) {
  Synchroniser sync{{}, kAll};
  for (double t = 0; t <= 80; t += 5) {
    sync.push_imu(imu(t + 1));
    sync.push_legs(legs(t + 2));
    sync.push_body_velocity(body_velocity(t));
  }
  for (const double t : {20.0, 50.0}) {
    sync.push_color(color(t));
    sync.push_depth(depth(t));
  }
  const auto packets = pop_all(sync, 82);
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_THAT(times_ms(packets[0].imu), Pointwise(DoubleEq(), {1.0, 6.0, 11.0, 16.0, 21.0}));
  EXPECT_THAT(times_ms(packets[1].imu),
              Pointwise(DoubleEq(), {16.0, 21.0, 26.0, 31.0, 36.0, 41.0, 46.0, 51.0}));
  EXPECT_THAT(times_ms(packets[1].legs),
              Pointwise(DoubleEq(), {17.0, 22.0, 27.0, 32.0, 37.0, 42.0, 47.0, 52.0}));
  // A sample exactly at each end bounds it: none beyond is needed.
  EXPECT_THAT(times_ms(packets[1].body_velocity),
              Pointwise(DoubleEq(), {20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0}));
}

TEST(Synchroniser, MovesImuStampsOntoTheCamerasTimeLine) {
  Synchroniser sync{{}, {.imu = StampInfo{}, .timeshift_cam_imu = from_ms(7)}};
  for (const double t : {100.0, 105.0, 110.0}) {
    sync.push_imu(imu(t));
  }
  sync.push_color(color(100));
  sync.push_depth(depth(100));
  const auto packets = pop_all(sync, 110);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_THAT(times_ms(packets[0].imu), Pointwise(DoubleEq(), {93.0, 98.0, 103.0}));
}

TEST(Synchroniser, WaitsForTheImuButNotBeyondTheWait) {
  Synchroniser sync{{}, kWithImu};
  sync.push_imu(imu(90));
  sync.push_color(color(100, 10));
  sync.push_depth(depth(100, 10));
  ASSERT_TRUE(sync.deadline());
  EXPECT_EQ(*sync.deadline(), host_ms(210));
  EXPECT_TRUE(pop_all(sync, 209.9).empty());
  EXPECT_EQ(pop_all(sync, 210).size(), 1U);
  EXPECT_EQ(sync.counters().wait_expired, 1U);
  EXPECT_EQ(sync.counters().imu.silences, 0U);
}

TEST(Synchroniser, DoesNotWaitForASilentStreamUntilItIsHeardAgain) {
  Synchroniser sync{{}, kWithImu};
  sync.push_imu(imu(0));
  for (double t = 600; t <= 660; t += 30) {
    sync.push_color(color(t));
    sync.push_depth(depth(t));
    EXPECT_EQ(pop_all(sync, t).size(), 1U) << t;
  }
  EXPECT_EQ(sync.counters().imu.silences, 1U);
  EXPECT_EQ(sync.counters().wait_expired, 0U);
  sync.push_imu(imu(670));
  sync.push_color(color(690));
  sync.push_depth(depth(690));
  EXPECT_TRUE(pop_all(sync, 690).empty());
  sync.push_imu(imu(691));
  EXPECT_EQ(pop_all(sync, 691).size(), 1U);
}

TEST(Synchroniser, AStreamThatNeverCameIsWaitedForOnlyAtTheBeginning) {
  Synchroniser sync{{}, kWithImu};
  std::size_t packets = 0;
  for (double t = 0; t <= 900; t += 30) {
    sync.push_color(color(t));
    sync.push_depth(depth(t));
    const auto popped = pop_all(sync, t);
    packets += popped.size();
    if (t > 500) {
      EXPECT_FALSE(popped.empty()) << t;
    }
  }
  EXPECT_EQ(packets, 31U);
  EXPECT_EQ(sync.counters().imu.silences, 1U);
}

TEST(Synchroniser, WaitsForDepthAgainWhenTheWholeCameraWasAway) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_color(color(100));
  sync.push_depth(depth(100));
  ASSERT_EQ(pop_all(sync, 100).size(), 1U);
  sync.push_color(color(1100));
  EXPECT_TRUE(pop_all(sync, 1101).empty()) << "depth of the same instant is about to come";
  sync.push_depth(depth(1100));
  const auto packets = pop_all(sync, 1101);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_TRUE(packets[0].depth);
  EXPECT_EQ(sync.counters().depth.silences, 0U);
}

TEST(Synchroniser, DepthThatFellSilentIsCountedAndNotWaitedFor) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_depth(depth(0));
  for (double t = 0; t <= 900; t += 30) {
    sync.push_color(color(t));
    const auto popped = pop_all(sync, t);
    EXPECT_TRUE(t <= 500 || !popped.empty()) << t;
  }
  EXPECT_EQ(sync.counters().depth.silences, 1U);
  EXPECT_EQ(sync.counters().depth_missing, 30U);
}

TEST(Synchroniser, LateAndRepeatedColourFramesAreDroppedAndPacketsStayInOrder) {
  Synchroniser sync{{}, kCameraOnly};
  sync.push_color(color(130));
  sync.push_color(color(100));  // reordered, in time
  sync.push_color(color(130));  // duplicate of one that waits
  sync.push_depth(depth(100));
  sync.push_depth(depth(130));
  const auto packets = pop_all(sync, 140);
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_LT(packets[0].t, packets[1].t);
  sync.push_color(color(130));  // duplicate of one that left
  sync.push_color(color(115));  // late
  EXPECT_TRUE(flush_all(sync).empty());
  const StreamCounters& counters = sync.counters().color;
  EXPECT_EQ(counters.pushed, 5U);
  EXPECT_EQ(counters.used, 2U);
  EXPECT_EQ(counters.duplicate, 2U);
  EXPECT_EQ(counters.late, 1U);
  EXPECT_EQ(counters.reordered, 1U);
}

TEST(Synchroniser, ReorderedImuSamplesArePutInTheirPlace) {
  Synchroniser sync{{}, kWithImu};
  for (const double t : {0.0, 10.0, 5.0, 20.0, 15.0}) {
    sync.push_imu(imu(t));
  }
  sync.push_color(color(18));
  sync.push_depth(depth(18));
  const auto packets = pop_all(sync, 20);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_THAT(times_ms(packets[0].imu), Pointwise(DoubleEq(), {0.0, 5.0, 10.0, 15.0, 20.0}));
  EXPECT_EQ(sync.counters().imu.reordered, 2U);
}

TEST(Synchroniser, BrokenSamplesAreCountedAndDropped) {
  Synchroniser sync{{}, kAll};
  auto broken_imu = imu(1);
  broken_imu.sample.gyro_radps.x() = std::numeric_limits<double>::quiet_NaN();
  sync.push_imu(broken_imu);
  auto broken_legs = legs(1);
  broken_legs.sample.valid[2] = true;
  broken_legs.sample.joints[2 * kJointsPerLeg].q_rad = std::numeric_limits<double>::infinity();
  sync.push_legs(broken_legs);
  broken_legs.sample.valid[2] = false;  // that leg is not to be read
  sync.push_legs(broken_legs);
  auto broken_velocity = body_velocity(1);
  broken_velocity.sample.v_base_mps.z() = std::numeric_limits<double>::quiet_NaN();
  sync.push_body_velocity(broken_velocity);
  sync.push_color({DeviceTime<CameraClock>{from_ms(1)}, host_ms(1), ColorFrame{}});
  sync.push_color({DeviceTime<CameraClock>{Duration::max()}, host_ms(1), ColorFrame{tiny_frame()}});
  sync.push_color(
      {DeviceTime<CameraClock>{Duration::min()}, HostTime::min(), ColorFrame{tiny_frame()}});
  EXPECT_TRUE(flush_all(sync).empty());
  EXPECT_EQ(sync.counters().imu.invalid, 1U);
  EXPECT_EQ(sync.counters().legs.invalid, 1U);
  EXPECT_EQ(sync.counters().legs.unused, 1U);
  EXPECT_EQ(sync.counters().body_velocity.invalid, 1U);
  EXPECT_EQ(sync.counters().color.invalid, 3U);
}

TEST(Synchroniser, OneStampFarInTheFutureDoesNotMakeTheRestLate) {
  Synchroniser sync{{}, kCameraOnly};
  for (double t = 0; t < 300; t += 30) {
    sync.push_color(t == 150 ? color(3'600'000, -3'599'850) : color(t));
    sync.push_depth(depth(t));
    EXPECT_EQ(pop_all(sync, t).size(), t == 150 ? 0U : 1U) << t;
  }
  EXPECT_EQ(sync.counters().color.outlier, 1U);
}

TEST(Synchroniser, GoesOnAfterALongGapAtThePriceOfOneFrame) {
  Synchroniser sync{{}, kCameraOnly};
  for (const double t : {0.0, 30.0, 60'000.0, 60'030.0, 60'060.0}) {
    sync.push_color(color(t));
    sync.push_depth(depth(t));
  }
  EXPECT_EQ(pop_all(sync, 60'060).size(), 4U);
  EXPECT_EQ(sync.counters().color.outlier, 1U);
  EXPECT_EQ(sync.counters().depth.outlier, 1U);
}

TEST(Synchroniser, AFullBufferGivesUpTheOldestAndCounts) {
  Synchroniser sync{{.frame_capacity = 4, .sample_capacity = 8}, kWithImu};
  for (int i = 0; i < 20; ++i) {
    sync.push_imu(imu(i));
    sync.push_color(color(100 + 30 * i));
  }
  EXPECT_EQ(sync.counters().imu.overflow, 12U);
  EXPECT_EQ(sync.counters().color.overflow, 16U);
  const auto packets = flush_all(sync);
  ASSERT_EQ(packets.size(), 4U);
  EXPECT_EQ(packets[0].t, host_ms(100 + 30 * 16));
  EXPECT_THAT(times_ms(packets[0].imu).front(), DoubleEq(12.0));
}

TEST(Synchroniser, AStuckCameraClockYieldsOnePacketAndDuplicates) {
  Synchroniser sync{{}, kCameraOnly};
  for (int i = 0; i < 10; ++i) {
    sync.push_color(color(100, 30 * i));
    sync.push_depth(depth(100, 30 * i));
  }
  EXPECT_EQ(pop_all(sync, 400).size(), 1U);
  EXPECT_EQ(sync.counters().color.duplicate, 9U);
  EXPECT_EQ(sync.counters().depth.duplicate, 9U);
}

}  // namespace
}  // namespace geoflow::timesync::tests
