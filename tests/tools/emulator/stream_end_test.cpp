#include <cstdint>

#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"

#include "device_fixture.hpp"

namespace geoflow::emulator {
namespace {

constexpr Duration kMillisecond{1'000'000};
constexpr Duration kFrame{33'333'333};
constexpr std::uint32_t k30Fps = 333333;

/// Depth of 640 x 480 at 30 Hz is committed; nobody has fetched yet.
struct StreamEnd : DeviceTest {
  void commit_depth(int frames) {
    for (int i = 0; i < frames; ++i) {
      world->add_images(static_cast<std::uint8_t>(i), i * kFrame);
    }
    plug();
    ASSERT_TRUE(commit(1, 1, 5, k30Fps));
  }
};

TEST_F(StreamEnd, DropsTheOldestFramesThatNobodyFetches) {
  commit_depth(20);
  EXPECT_TRUE(fetch(0x82, kMillisecond).empty());
  now += Duration{1'000'000'000};
  const auto payloads = fetch(0x82, kMillisecond);
  ASSERT_EQ(payloads.size(), 4U);
  EXPECT_EQ(field<std::uint32_t>(payloads[3], 28), 20U);
  EXPECT_EQ(camera->counters().frames_dropped, 16U);
}

TEST_F(StreamEnd, ClearHaltEmptiesAStreamAndFetchingGoesOn) {
  commit_depth(60);
  EXPECT_EQ(fetch(0x82, Duration{100'000'000}).size(), 3U);
  now += Duration{70'000'000};
  ASSERT_TRUE(set(0x02, 1, 0, 0x82, {}));
  EXPECT_EQ(camera->next_due(0x82, now), HostTime::max())
      << "nobody fetches: the world stands still";
  now += Duration{10'000'000'000};
  EXPECT_EQ(fetch(0x82, Duration{100'000'000}).size(), 3U);
}

TEST_F(StreamEnd, SettingItsInterfaceEndsAStream) {
  commit_depth(60);
  EXPECT_EQ(fetch(0x82, Duration{100'000'000}).size(), 3U);
  EXPECT_FALSE(set(0x01, 11, 1, 1, {})) << "there is no other setting";
  ASSERT_TRUE(set(0x01, 11, 0, 4, {})) << "colour's";
  EXPECT_NE(camera->next_due(0x82, now), HostTime::max());
  ASSERT_TRUE(set(0x01, 11, 0, 1, {}));
  EXPECT_EQ(camera->next_due(0x82, now), HostTime::max());
}

TEST_F(StreamEnd, AStreamThatTheHostHasLeftEndsByItself) {
  commit_depth(60);
  EXPECT_EQ(fetch(0x82, Duration{100'000'000}).size(), 3U);
  now += Duration{10'000'000'000};
  EXPECT_TRUE(get(0x80, 8, 0, 0, 1));
  EXPECT_EQ(camera->next_due(0x82, now), HostTime::max()) << "the world stands still";
  // It goes on where it was left: none of the ten seconds' frames has been lost or waits.
  EXPECT_EQ(fetch(0x82, Duration{100'000'000}).size(), 3U);
  EXPECT_EQ(camera->counters().frames_dropped, 0U);
}

}  // namespace
}  // namespace geoflow::emulator
