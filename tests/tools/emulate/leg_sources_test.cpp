#include "emulate/leg_sources.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr double kGravity_mps2 = 9.81;

TEST(SimulatedLegs, WalkAtFiveHundredHertzOnAClockOfTheirOwn) {
  std::uint64_t count = 0;
  Duration last{};
  double largest_rate_radps = 0;
  double accel_sum_mps2 = 0;
  const HostTime begin = HostClock::now();
  const auto played = play_simulated_legs(
      {.seed = 3, .duration_s = 4}, milliseconds{1000}, [&](const drivers::EmittedSample& sample) {
        EXPECT_EQ(sample.device_time, milliseconds{1000} + count * milliseconds{2});
        EXPECT_GE(HostClock::now() - begin, sample.device_time - milliseconds{1000});
        for (const JointState& joint : sample.legs.joints) {
          largest_rate_radps = std::max(largest_rate_radps, joint.dq_radps);
        }
        accel_sum_mps2 += sample.body_imu.accel_mps2.z();
        last = sample.device_time;
        ++count;
        return true;
      });
  ASSERT_TRUE(played) << played.error().message;
  EXPECT_EQ(count, 2001U);
  EXPECT_GT(largest_rate_radps, 1.0);  // it does walk
  EXPECT_NEAR(accel_sum_mps2 / static_cast<double>(count), kGravity_mps2, 0.3);
}

TEST(SimulatedLegs, EndWhenTheHandlerSaysSo) {
  int count = 0;
  ASSERT_TRUE(
      play_simulated_legs({}, {}, [&](const drivers::EmittedSample&) { return ++count < 5; }));
  EXPECT_EQ(count, 5);
}

constexpr int kRounds = 50;

/// A CAN log of kRounds rounds, of which the first begins at 100 s.
void write_walk(const std::filesystem::path& log) {
  std::ofstream file{log};
  for (int round = 0; round < kRounds; ++round) {
    const int stamp_us = 2000 * round;
    // SYNC of round, then angles, rates and torques of the four legs, all the same.
    file << fmt::format("(100.{:06}) can0 080#{:02X}{:02X}{:02X}00\n", stamp_us, round,
                        200 * round % 256, 200 * round / 256 % 256);
    for (const int base : {0x110, 0x120, 0x130}) {
      for (int leg = 0; leg < 4; ++leg) {
        file << fmt::format("(100.{:06}) can0 {:03X}#6400C8002C01{:02X}00\n", stamp_us + 100,
                            base + leg, round);
      }
    }
  }
}

TEST(RecordedLegs, ComeAtTheRecordingsPace) {
  const tests::TemporaryDirectory directory;
  const auto log = directory.path() / "walk.log";
  write_walk(log);
  int count = 0;
  std::optional<drivers::EmittedSample> last;
  const auto played =
      play_recorded_legs(log, {}, milliseconds{500}, [&](const drivers::EmittedSample& sample) {
        ++count;
        last = sample;
        return true;
      });
  ASSERT_TRUE(played) << played.error().message;
  EXPECT_EQ(count, kRounds);
  ASSERT_TRUE(last);
  EXPECT_EQ(last->device_time, milliseconds{500 + 2 * (kRounds - 1)});
  EXPECT_DOUBLE_EQ(last->legs.joints[1].q_rad, 0.04);
  EXPECT_DOUBLE_EQ(last->legs.joints[2].dq_radps, 0.6);
  EXPECT_TRUE(last->body_imu.gyro_radps.isZero());
  EXPECT_FALSE(play_recorded_legs(directory.path() / "none.log", {}, {}, {}));
}

TEST(RecordedLegs, ComeWhenTheirShiftSays) {
  const tests::TemporaryDirectory directory;
  const auto log = directory.path() / "walk.log";
  write_walk(log);
  const HostTime first{std::chrono::seconds{100}};
  const HostTime begin = HostClock::now() + std::chrono::seconds{2};  // opening takes less
  int count = 0;
  ASSERT_TRUE(play_recorded_legs(log, begin - first, {}, [&](const drivers::EmittedSample& sample) {
    EXPECT_GE(HostClock::now(), begin + count * milliseconds{2});
    EXPECT_EQ(sample.device_time, count * milliseconds{2});
    ++count;
    return true;
  }));
  EXPECT_EQ(count, kRounds);
}

TEST(RecordedLegs, AreLeftOutWhereTheirTimeIsOver) {
  const tests::TemporaryDirectory directory;
  const auto log = directory.path() / "walk.log";
  write_walk(log);
  const Duration long_ago = HostClock::now() - HostTime{std::chrono::seconds{200}};
  int count = 0;
  ASSERT_TRUE(play_recorded_legs(log, long_ago, {}, [&](const drivers::EmittedSample&) {
    ++count;
    return true;
  }));
  EXPECT_EQ(count, 0);
}

class CountingSink final : public LegSink, public ImuSink {
 public:
  void on_legs(const Arrival<LegClock, LegSample>& /*sample*/) override { ++legs; }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    accel_z_mps2 = sample.sample.accel_mps2.z();
    ++imus;
  }
  std::atomic<std::uint64_t> legs{0};
  std::atomic<std::uint64_t> imus{0};
  std::atomic<double> accel_z_mps2{0};
};

TEST(EmulatedRobot, IsHeardOverDdsAsARobotIs) {
  const drivers::DdsRobotOptions network{.interface = "lo",
                                         .domain = static_cast<int>(10 + ::getpid() % 200)};
  auto emitter = drivers::open_dds_emitter(network);
  if (!emitter && emitter.error().code == ErrorCode::kUnsupported) {
    GTEST_SKIP() << emitter.error().message;
  }
  ASSERT_TRUE(emitter) << emitter.error().message;
  auto robot = drivers::DdsRobot::open(network);
  ASSERT_TRUE(robot) << robot.error().message;
  CountingSink sink;
  ASSERT_TRUE((*robot)->legs().start(sink));
  ASSERT_TRUE((*robot)->body_imu().start(sink));
  // The first messages may go before the two know each other: 30 s are patience, not the length.
  const auto played = play_simulated_legs({.duration_s = 30}, milliseconds{1000},
                                          [&](const drivers::EmittedSample& sample) {
                                            EXPECT_TRUE((*emitter)->emit(sample));
                                            return sink.legs < 500;
                                          });
  ASSERT_TRUE(played) << played.error().message;
  EXPECT_GE(sink.legs, 500U);
  EXPECT_GT(sink.imus, 0U);
  EXPECT_GT(sink.accel_z_mps2, 0.5 * kGravity_mps2);
  EXPECT_EQ((*robot)->legs().health().rejected, 0U);
}

TEST(EmulatedRobot, AnInterfaceThatIsNotThereIsAnError) {
  EXPECT_FALSE(drivers::open_can_emitter({.interface = "nocan7"}));
  EXPECT_FALSE(drivers::open_dds_emitter({.interface = "nonet7"}));
  EXPECT_THAT(drivers::open_can_emitter({.dictionary = "/nonexistent.dbc"}).error().message,
              HasSubstr("/nonexistent.dbc"));
}

}  // namespace
}  // namespace geoflow::tools
