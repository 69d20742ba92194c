#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/timesync/synchroniser.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

#include "scripted_streams.hpp"

/// Packets while nothing comes from the colour camera.
namespace geoflow::timesync::tests {
namespace {

/// A camera that is away for two seconds while IMU and legs go on.
class SilentColour : public ::testing::Test {
 protected:
  static constexpr double kAwayMs = 1000;
  static constexpr double kBackMs = 3000;
  static constexpr double kEndMs = 4000;
  static constexpr double kImuMs = 5;
  static constexpr double kFrameMs = 33;
  static constexpr double kFrameDelayMs = 60;

  std::vector<SyncedPacket> run(bool color_at_first = true) {
    std::vector<SyncedPacket> packets;
    double next_frame_ms = 0;
    for (double now_ms = 0; now_ms < kEndMs; now_ms += kImuMs) {
      sync_.push_imu(imu(now_ms));
      while (next_frame_ms + kFrameDelayMs <= now_ms) {
        const bool away = next_frame_ms >= kAwayMs && next_frame_ms < kBackMs;
        if (!away && (color_at_first || next_frame_ms >= kBackMs)) {
          sync_.push_color(color(next_frame_ms, kFrameDelayMs));
        }
        next_frame_ms += kFrameMs;
      }
      for (auto& packet : pop_all(sync_, now_ms)) {
        packets.push_back(std::move(packet));
      }
    }
    return packets;
  }

  static std::size_t blind(const std::vector<SyncedPacket>& packets) {
    return static_cast<std::size_t>(
        std::ranges::count_if(packets, [](const SyncedPacket& p) { return !p.color; }));
  }

  Synchroniser sync_{{}, {.imu = StampInfo{.domain = StampDomain::kHost}}};
};

TEST_F(SilentColour, PacketsGoOnWithoutImagesAndEachSampleIsInOne) {
  const auto packets = run();
  const double blind_ms = kBackMs - kAwayMs;
  EXPECT_NEAR(static_cast<double>(blind(packets)), blind_ms / kFrameMs, 2);
  EXPECT_EQ(sync_.counters().blind, blind(packets));
  EXPECT_EQ(sync_.counters().imu.unused, 0U);
  // The first frame after the silence is taken, and no other is lost.
  EXPECT_EQ(sync_.counters().color.used, sync_.counters().color.pushed);
  for (std::size_t i = 1; i < packets.size(); ++i) {
    EXPECT_LT(packets[i - 1].t, packets[i].t);
    EXPECT_EQ(packets[i].sequence, packets[i - 1].sequence + 1);
    EXPECT_LE(packets[i].t - packets[i - 1].t, from_ms(2 * kFrameMs));
    ASSERT_FALSE(packets[i].imu.empty());
    EXPECT_LE(packets[i].imu.front().t, packets[i - 1].t);
    EXPECT_GE(packets[i].imu.back().t, packets[i].t);
  }
}

TEST_F(SilentColour, ACameraThatIsNotThereYetIsNotWaitedForLong) {
  const auto packets = run(false);
  ASSERT_FALSE(packets.empty());
  EXPECT_FALSE(packets.front().color);
  EXPECT_EQ(packets.front().t, host_ms(0));
  EXPECT_TRUE(packets.back().color);
  EXPECT_NEAR(static_cast<double>(blind(packets)), kBackMs / kFrameMs, 2);
}

TEST(SilentColourAlone, ATimeWithoutAnySamplesIsSteppedOver) {
  Synchroniser sync{{}, {}};
  sync.push_color(color(0));
  sync.push_legs(legs(0));
  EXPECT_EQ(pop_all(sync, 1000).size(), 1U);
  constexpr double kLaterMs = 3'600'000;
  for (int i = 0; i < 3; ++i) {  // a leap is believed when the second sample agrees
    sync.push_legs(legs(kLaterMs + i));
  }
  const auto packets = pop_all(sync, kLaterMs + 200);
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_EQ(packets.front().t, host_ms(kLaterMs + 1));
  EXPECT_EQ(packets.back().t - packets.front().t, SynchroniserConfig{}.blind_interval);
  EXPECT_TRUE(pop_all(sync, 2 * kLaterMs).empty());
}

}  // namespace
}  // namespace geoflow::timesync::tests
