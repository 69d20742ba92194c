#include <cstdint>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"

#include "device_fixture.hpp"
#include "scripted_world.hpp"

namespace geoflow::emulator {
namespace {

constexpr Duration kFrame{33'333'333};
constexpr std::uint32_t k30Fps = 333333;

TEST_F(DeviceTest, TellsWhereTheRecordingIsOnTheHostsClock) {
  constexpr Duration kRecorded{1'000'000'000'000};
  for (int i = 0; i < 4; ++i) {
    world->add({.t = i * kFrame,
                .t_sent = i * kFrame,
                .t_sent_recorded = kRecorded + i * kFrame,
                .sample = ImuSample{}});
  }
  plug();
  EXPECT_FALSE(camera->recording_shift());
  ASSERT_TRUE(commit(1, 1, 5, k30Fps));
  const HostTime begin = now;
  (void)fetch(0x82, 3 * kFrame / 2);
  EXPECT_EQ(camera->recording_shift(), begin.time_since_epoch() - kRecorded);
  ASSERT_TRUE(set(0x02, 1, 0, 0x82, {}));  // nobody fetches: the world stands still
  constexpr Duration kPause{7'000'000'000};
  now += kPause;
  (void)fetch(0x82, 3 * kFrame / 2);
  EXPECT_EQ(camera->recording_shift(), begin.time_since_epoch() - kRecorded + kPause);
}

}  // namespace
}  // namespace geoflow::emulator
