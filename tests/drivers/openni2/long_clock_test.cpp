#include <cstdint>

#include <gtest/gtest.h>

#include "openni2/module/camera_feed.hpp"

namespace geoflow::drivers::openni2 {
namespace {

constexpr std::uint64_t kPeriod_us = 1ULL << 32U;

TEST(LongClock, GoesOnWhereTheCountWraps) {
  LongClock clock;
  EXPECT_EQ(clock.extend(0xffff'0000), 0xffff'0000ULL);
  EXPECT_EQ(clock.extend(0x0000'0010), kPeriod_us + 0x10);
  // The other stream's frame of the same time is a little behind.
  EXPECT_EQ(clock.extend(0xffff'fff0), kPeriod_us - 0x10);
  EXPECT_EQ(clock.extend(0x0000'8000), kPeriod_us + 0x8000);
}

TEST(LongClock, GoesOnWhereTheCountBeginsAnew) {
  LongClock clock;
  EXPECT_EQ(clock.extend(900'000'000), 900'000'000U);
  // After a reset of the camera: from the newest time, and from there as it counts.
  EXPECT_EQ(clock.extend(2'000'000), 900'000'000U);
  EXPECT_EQ(clock.extend(2'033'333), 900'033'333U);
}

TEST(LongClock, HasNoTimeBeforeZero) {
  LongClock clock;
  EXPECT_EQ(clock.extend(10), 10U);
  EXPECT_EQ(clock.extend(0xffff'ffff), 0U);
}

}  // namespace
}  // namespace geoflow::drivers::openni2
