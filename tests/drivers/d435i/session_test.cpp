#include "d435i/core/session.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/bytes.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/scripted_camera.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Remembers when what came.
class Recorder final : public TransportSink {
 public:
  void on_frame(const RawFrame& frame) override {
    frames.at(static_cast<std::size_t>(frame.stream)).push_back(frame.t_arrival);
  }
  void on_imu(const RawImu& imu) override {
    imu_times.at(imu.reading.sensor == ImuSensor::kAccelerometer ? 0 : 1).push_back(imu.t_arrival);
  }
  void on_damaged_frame(VideoStream /*stream*/, std::string_view /*why*/) override { ++damaged; }
  void on_damaged_imu(std::string_view /*why*/) override {}

  std::array<std::vector<HostTime>, kVideoStreams> frames;
  std::array<std::vector<HostTime>, 2> imu_times;
  int damaged = 0;
};

class SessionTest : public testing::Test {
 protected:
  void SetUp() override { log::set_level(log::Level::kError); }
  void TearDown() override { log::set_level(log::Level::kInfo); }
  static SessionOptions options() {
    return {.depth = VideoMode{PixelCoding::kZ16, 640, 480, 30},
            .color = VideoMode{PixelCoding::kYuyv, 640, 480, 30}};
  }

  /// Steps the session for so long on the camera's clock.
  void run_for(Duration duration) {
    const HostTime end = camera_.now + duration;
    while (camera_.now < end) {
      const Duration wait = session_.step(camera_.now, milliseconds{50});
      camera_.now += wait;
    }
  }
  /// Steps until `done`; the time that it took, or the limit.
  Duration run_until(const std::function<bool()>& done, Duration limit = seconds{60}) {
    const HostTime begin = camera_.now;
    while (!done() && camera_.now < begin + limit) {
      const Duration wait = session_.step(camera_.now, milliseconds{50});
      camera_.now += wait;
    }
    return camera_.now - begin;
  }
  [[nodiscard]] std::size_t frames(VideoStream stream) const {
    return recorder_.frames.at(static_cast<std::size_t>(stream)).size();
  }

  ScriptedCamera camera_;
  Recorder recorder_;
  Session session_{options(), camera_.opener(), recorder_, nullptr, camera_.serial};
};

TEST_F(SessionTest, StreamsAllThatThereIs) {
  run_for(seconds{2});
  EXPECT_NEAR(static_cast<double>(frames(VideoStream::kDepth)), 60, 1);
  EXPECT_NEAR(static_cast<double>(frames(VideoStream::kColor)), 60, 1);
  EXPECT_NEAR(static_cast<double>(recorder_.imu_times[0].size()), 400, 2);
  EXPECT_NEAR(static_cast<double>(recorder_.imu_times[1].size()), 400, 2);
  EXPECT_EQ(session_.state(), SessionState::kStreaming);
  EXPECT_TRUE(session_.trouble().empty());
  EXPECT_EQ(session_.counters().opens, 1U);
  EXPECT_EQ(session_.counters().stalls, 0U);
  EXPECT_EQ(camera_.controls.at(11), from_hex("01"));  // automatic exposure
}

TEST_F(SessionTest, SetsWhatIsAskedFor) {
  auto wanted = options();
  wanted.emitter = false;
  wanted.exposure_us = 8500;
  wanted.laser_power_mw = 150;
  Session session{wanted, camera_.opener(), recorder_};
  (void)session.step(camera_.now, milliseconds{50});
  EXPECT_EQ(camera_.controls.at(2), from_hex("00"));
  EXPECT_EQ(camera_.controls.at(3), from_hex("34 21 00 00"));
  EXPECT_EQ(camera_.controls.at(4), from_hex("96 00"));
  EXPECT_EQ(camera_.controls.at(11), from_hex("00"));
}

TEST_F(SessionTest, ARefusedControlDoesNotKeepItFromStreaming) {
  camera_.refuse_controls = true;
  run_for(seconds{1});
  EXPECT_GT(frames(VideoStream::kDepth), 25U);
}

TEST_F(SessionTest, ASilentStreamAloneIsRestarted) {
  run_for(seconds{1});
  camera_.silent_starts[0] = 1;  // depth is silent until it is started anew
  const Duration took = run_until([&] { return session_.counters().stream_restarts == 1; });
  EXPECT_GT(took, milliseconds{250});
  EXPECT_LT(took, milliseconds{450});  // ten frames and one wait
  EXPECT_EQ(session_.trouble(), "depth fell silent");
  const auto color_before = frames(VideoStream::kColor);
  const auto depth_before = frames(VideoStream::kDepth);
  run_for(seconds{1});
  EXPECT_GT(frames(VideoStream::kDepth), depth_before + 25);
  EXPECT_GT(frames(VideoStream::kColor), color_before + 25);
  EXPECT_EQ(camera_.count("start colour"), 1);
  EXPECT_EQ(camera_.count("start depth"), 2);
  EXPECT_TRUE(session_.trouble().empty());
  // Once all is well again, the ladder begins at its first rung.
  camera_.silent_starts[1] = 1;
  run_until([&] { return session_.counters().stalls == 2; });
  EXPECT_EQ(session_.counters().stream_restarts, 2U);
  EXPECT_EQ(session_.counters().camera_restarts, 0U);
}

TEST_F(SessionTest, TheLadderIsClimbedRungByRung) {
  run_for(seconds{1});
  camera_.silent = {true, true};
  camera_.silent_until_hardware_reset = true;
  camera_.calls.clear();
  run_until([&] { return session_.counters().hardware_resets == 1; });
  const auto& counters = session_.counters();
  EXPECT_EQ(counters.stream_restarts, 2U);  // of both
  EXPECT_EQ(counters.camera_restarts, 1U);
  EXPECT_EQ(counters.port_resets, 1U);
  EXPECT_EQ(counters.losses, 2U);
  camera_.silent = {false, false};
  const auto before = frames(VideoStream::kDepth);
  const Duration took = run_until([&] { return frames(VideoStream::kDepth) > before; });
  // The camera is away for three seconds; it is looked for at least every two.
  EXPECT_LT(took, camera_.away_after_reset + seconds{2} + milliseconds{100});
  run_for(seconds{1});
  EXPECT_TRUE(session_.trouble().empty());
  EXPECT_EQ(session_.counters().hardware_resets, 1U);
}

TEST_F(SessionTest, APortResetHelpsWhereRestartsDoNot) {
  run_for(seconds{1});
  camera_.silent_until_port_reset = true;
  camera_.away_after_reset = milliseconds{500};
  run_until([&] { return session_.counters().port_resets == 1; });
  const auto before = frames(VideoStream::kColor);
  const Duration took = run_until([&] { return frames(VideoStream::kColor) > before; });
  EXPECT_LT(took, seconds{2});  // after the reset, the time away included
  EXPECT_EQ(session_.counters().hardware_resets, 0U);
}

TEST_F(SessionTest, UnplugIsSeenAtOnceAndReplugWithinTwoSeconds) {
  run_for(seconds{1});
  camera_.unplug();
  const Duration seen = run_until([&] { return session_.state() == SessionState::kAway; });
  EXPECT_LT(seen, milliseconds{100});
  EXPECT_EQ(session_.trouble(), "the camera is gone");
  EXPECT_EQ(session_.link(), nullptr);
  camera_.looks.clear();
  run_for(seconds{20});
  ASSERT_GT(camera_.looks.size(), 8U);
  EXPECT_LT(camera_.looks.size(), 20U);  // it backs off
  for (std::size_t i = 1; i < camera_.looks.size(); ++i) {
    EXPECT_LE(camera_.looks[i] - camera_.looks[i - 1], seconds{2});
  }
  camera_.plug_in();
  const auto before = frames(VideoStream::kDepth);
  const Duration back = run_until([&] { return frames(VideoStream::kDepth) > before; });
  EXPECT_LT(back, seconds{2} + milliseconds{100});
  run_for(seconds{1});
  EXPECT_TRUE(session_.trouble().empty());
}

TEST_F(SessionTest, AHundredReplugsEachAreTheSame) {
  run_for(milliseconds{200});
  for (int i = 0; i < 100; ++i) {
    camera_.unplug();
    run_until([&] { return session_.state() == SessionState::kAway; });
    camera_.plug_in();
    const auto before = frames(VideoStream::kColor);
    const Duration back = run_until([&] { return frames(VideoStream::kColor) > before; });
    ASSERT_LT(back, milliseconds{300}) << "at cycle " << i;
    run_for(milliseconds{200});
  }
  EXPECT_EQ(session_.counters().losses, 100U);
  EXPECT_EQ(session_.counters().opens, 101U);
}

TEST_F(SessionTest, AnotherCameraIsNotTakenForTheFirst) {
  run_for(seconds{1});
  camera_.unplug();
  run_for(seconds{1});
  camera_.plug_in();
  camera_.serial = "999999999999";
  run_for(seconds{5});
  EXPECT_EQ(session_.state(), SessionState::kAway);
}

TEST_F(SessionTest, AUsb2LinkWithoutTheModeIsSaidInWords) {
  camera_.super_speed = false;
  auto wanted = options();
  wanted.depth->width = 848;
  Session session{wanted, camera_.opener(), recorder_};
  (void)session.step(camera_.now, milliseconds{50});
  EXPECT_EQ(session.state(), SessionState::kAway);
  EXPECT_NE(session.trouble().find("848x480 at 30 Hz on this link; it has"), std::string::npos)
      << session.trouble();
}

TEST_F(SessionTest, ASilentSensorIsRestartedAndVideoGoesOn) {
  run_for(seconds{1});
  camera_.imu_silent[1] = true;
  const Duration seen = run_until([&] { return !session_.imu_trouble().empty(); });
  EXPECT_LT(seen, milliseconds{1100});
  EXPECT_EQ(session_.imu_trouble(), "the gyroscope is silent");
  const auto before = frames(VideoStream::kDepth);
  run_for(seconds{60});
  EXPECT_NEAR(static_cast<double>(frames(VideoStream::kDepth) - before), 1800, 3);
  EXPECT_GE(session_.counters().imu_restarts, 3U);
  EXPECT_LE(session_.counters().imu_restarts, 8U);  // at intervals that double
  EXPECT_EQ(camera_.count("start accel"), 1);
  EXPECT_TRUE(session_.trouble().empty());
  camera_.imu_silent[1] = false;
  run_for(seconds{1});
  EXPECT_TRUE(session_.imu_trouble().empty());
}

TEST_F(SessionTest, DamagedFramesAreCountedAndCountAsSilence) {
  run_for(seconds{1});
  camera_.damaged[0] = true;
  run_for(milliseconds{300});
  EXPECT_GT(recorder_.damaged, 5);
  EXPECT_EQ(session_.counters().damaged[0], static_cast<std::uint64_t>(recorder_.damaged));
  run_for(milliseconds{300});
  EXPECT_EQ(session_.counters().stalls, 1U);
}

TEST_F(SessionTest, ClosingStopsEverything) {
  run_for(seconds{1});
  session_.close();
  EXPECT_EQ(camera_.count("stop depth"), 1);
  EXPECT_EQ(camera_.count("stop colour"), 1);
  EXPECT_EQ(session_.link(), nullptr);
}

TEST_F(SessionTest, OneStreamAloneWithoutTheImuRunsAndRecovers) {
  SessionOptions wanted = options();
  wanted.color.reset();
  wanted.imu = false;
  Session session{wanted, camera_.opener(), recorder_};
  const auto run = [&](Duration duration) {
    const HostTime end = camera_.now + duration;
    while (camera_.now < end) {
      camera_.now += session.step(camera_.now, milliseconds{50});
    }
  };
  run(seconds{4});
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_GT(session.counters().frames[0], 100U);
  EXPECT_EQ(session.counters().frames[1], 0U);
  EXPECT_EQ(session.counters().imu_restarts, 0U);
  EXPECT_EQ(camera_.count("start colour"), 0);
  EXPECT_EQ(camera_.count("start gyro"), 0);
  camera_.silent[0] = true;
  run(seconds{1});
  EXPECT_EQ(session.trouble(), "depth fell silent");
  camera_.silent[0] = false;
  run(seconds{3});
  EXPECT_TRUE(session.trouble().empty()) << session.trouble();
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
