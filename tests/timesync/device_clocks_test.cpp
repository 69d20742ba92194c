#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/synchroniser.hpp"
#include "tests/support/data.hpp"

#include "clock_run.hpp"
#include "random_clock.hpp"
#include "scripted_streams.hpp"

/// The synchroniser on streams that are stamped by clocks of their own: camera 30 Hz and IMU 200
/// Hz, both 32-bit us.
namespace geoflow::timesync::tests {
namespace {

constexpr std::int64_t kFrameNs = 33'333'333;
constexpr std::int64_t kImuNs = 5'000'000;
constexpr double kImuJitterNs = 0.2 * kMsInNs;
constexpr double kCameraJitterNs = 0.5 * kMsInNs;

/// Two devices and the packets that come of them.
class Rig {
 public:
  /// `one_clock`: both devices are stamped by one, and it is known.
  explicit Rig(bool one_clock = false)
      : random_{geoflow::tests::test_seed(11)},
        sync_{{}, {.camera = kWrapping, .imu = kWrapping, .imu_on_camera_clock = one_clock}} {
    camera = draw_clock(random_, true);
    imu = one_clock ? camera : draw_clock(random_, true);
  }

  /// Runs [begin_s, end_s) in order of arrival (delays are under a period).
  void run(double begin_s, double end_s) {
    for (auto t_ns = static_cast<std::int64_t>(begin_s * kSecondNs);
         t_ns < static_cast<std::int64_t>(end_s * kSecondNs); t_ns += kImuNs) {
      sync_.push_imu({DeviceTime<ImuClock>{Duration{imu.stamp_ns(static_cast<double>(t_ns))}},
                      arrive(t_ns, imu_jitter_),
                      {}});
      for (; next_frame_ns_ <= t_ns; next_frame_ns_ += kFrameNs) {
        const Duration stamp{camera.stamp_ns(static_cast<double>(next_frame_ns_))};
        const HostTime arrival = arrive(next_frame_ns_, camera_jitter_) + camera_delay;
        truths.push_back(kHostStartNs + next_frame_ns_);
        sync_.push_depth({DeviceTime<CameraClock>{stamp}, arrival, DepthFrame{tiny_frame()}});
        sync_.push_color({DeviceTime<CameraClock>{stamp}, arrival, ColorFrame{tiny_frame()}});
      }
      while (auto packet = sync_.pop(HostTime{Duration{kHostStartNs + t_ns + kImuNs}})) {
        packet->color = {};
        packets.push_back(*std::move(packet));
        has_depth.push_back(static_cast<bool>(packets.back().depth));
        packets.back().depth = {};
      }
    }
  }

  [[nodiscard]] const SynchroniserCounters& counters() const { return sync_.counters(); }

  RandomClock camera;
  RandomClock imu;
  Duration camera_delay{};  ///< the least one, under a period
  std::vector<SyncedPacket> packets;
  std::vector<bool> has_depth;
  std::vector<std::int64_t> truths;  // of the frames

 private:
  HostTime arrive(std::int64_t t_ns, const Jitter& jitter) {
    return HostTime{
        Duration{kHostStartNs + t_ns + static_cast<std::int64_t>(jitter.draw_ns(random_))}};
  }

  Random random_;
  Jitter imu_jitter_ = exponential_jitter(kImuJitterNs);
  Jitter camera_jitter_ = exponential_jitter(kCameraJitterNs);
  std::int64_t next_frame_ns_ = 0;
  Synchroniser sync_;
};

TEST(DeviceClocks, FramesPairAndWindowsAreWholeOnUnrelatedClocks) {
  Rig rig;
  rig.run(0, 60);
  ASSERT_GE(rig.packets.size() + 2, rig.truths.size());
  for (std::size_t i = 150; i < rig.packets.size(); ++i) {
    const SyncedPacket& packet = rig.packets[i];
    const auto error_ns = static_cast<double>(packet.t.time_since_epoch().count() - rig.truths[i]);
    ASSERT_LE(std::abs(error_ns), kCameraJitterNs) << i;
    EXPECT_EQ(packet.depth_offset, Duration::zero()) << i;
    ASSERT_GE(packet.imu.size(), 7U) << i;
    EXPECT_LE(packet.imu.front().t, rig.packets[i - 1].t) << i;
    EXPECT_GE(packet.imu.back().t, packet.t) << i;
    for (std::size_t k = 1; k < packet.imu.size(); ++k) {
      EXPECT_NEAR(to_ms(packet.imu[k].t - packet.imu[k - 1].t), 5.0, 0.5) << i;
    }
  }
  EXPECT_EQ(rig.counters().depth_missing, 0U);
  EXPECT_EQ(rig.counters().camera_clock.jumps, 0U);
  EXPECT_EQ(rig.counters().imu.late, 0U);
}

TEST(DeviceClocks, OnOneClockTheImuTellsHowLateImagesAre) {
  Rig rig{true};
  rig.camera_delay = from_ms(28);
  rig.run(0, 60);
  ASSERT_GE(rig.packets.size() + 2, rig.truths.size());
  for (std::size_t i = 150; i < rig.packets.size(); ++i) {
    const std::int64_t placed_ns = rig.packets[i].t.time_since_epoch().count();
    ASSERT_LE(std::abs(static_cast<double>(placed_ns - rig.truths[i])), kCameraJitterNs) << i;
    EXPECT_GE(rig.packets[i].imu.back().t, rig.packets[i].t) << i;
  }
  EXPECT_EQ(rig.counters().depth_missing, 0U);
  EXPECT_EQ(rig.counters().color.late, 0U);
}

TEST(DeviceClocks, OnOneClockThatRestartsTheLagIsKept) {
  Rig rig{true};
  rig.camera_delay = from_ms(28);
  rig.run(0, 30);
  rig.camera.offset_ns += kWrap32Us / 3;
  rig.imu.offset_ns = rig.camera.offset_ns;
  rig.run(30, 60);
  for (std::size_t i = 1; i < rig.packets.size(); ++i) {
    ASSERT_LT(rig.packets[i - 1].t, rig.packets[i].t);
  }
  const auto last_error_ns =
      rig.packets.back().t.time_since_epoch().count() - rig.truths[rig.truths.size() - 1];
  EXPECT_LE(std::abs(static_cast<double>(last_error_ns)), static_cast<double>(2 * kFrameNs));
}

TEST(DeviceClocks, ACameraThatRestartsGoesOnAndIsCounted) {
  Rig rig;
  rig.run(0, 30);
  const std::size_t before = rig.packets.size();
  rig.camera.offset_ns += kWrap32Us / 3;
  rig.run(30, 60);
  EXPECT_EQ(rig.counters().camera_clock.jumps, 1U);
  constexpr std::size_t kFrames = 900;
  constexpr std::size_t kMostLost = 15;
  EXPECT_GE(rig.packets.size(), before + kFrames - kMostLost);
  for (std::size_t i = 1; i < rig.packets.size(); ++i) {
    ASSERT_LT(rig.packets[i - 1].t, rig.packets[i].t);
  }
  const auto last_error_ns =
      rig.packets.back().t.time_since_epoch().count() - rig.truths[rig.truths.size() - 1];
  EXPECT_LE(std::abs(static_cast<double>(last_error_ns)),
            static_cast<double>(kFrameNs) + kCameraJitterNs);
}

}  // namespace
}  // namespace geoflow::timesync::tests
