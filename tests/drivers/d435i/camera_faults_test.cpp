#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/fault.hpp"
#include "geoflow/tools/emulator/faulty_device.hpp"
#include "geoflow/tools/emulator/world.hpp"

#include "d435i/core/session.hpp"
#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/model_port.hpp"
#include "d435i/usb/usb_transport.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "scripted_world.hpp"

// What goes wrong between the emulated camera and the session above USB, how soon the session says
// so, and how soon all is well again after the fault has gone. All on the model's clock.

namespace geoflow::drivers::d435i::tests {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kInterval = std::chrono::microseconds{33'333};
constexpr Duration kImuInterval = milliseconds{5};
constexpr Duration kFaultStart = seconds{1};
constexpr double kMostAccel = 12;  // [m/s^2]: more was never sent

/// Two images by turns and an IMU at rest, without an end.
class EndlessWorld final : public emulator::World {
 public:
  EndlessWorld() {
    for (std::uint8_t i = 0; i < 2; ++i) {
      script_.add_images(i, Duration{});
    }
    for (auto& sample : images_) {
      sample = std::move(**script_.next());
    }
  }
  [[nodiscard]] const Calibration& calibration() const override { return script_.calibration(); }
  [[nodiscard]] Result<std::optional<emulator::WorldSample>> next() override {
    if (t_imu_ <= t_image_) {
      t_imu_ += kImuInterval;
      return emulator::WorldSample{
          .t = t_imu_, .t_sent = t_imu_, .sample = ImuSample{.accel_mps2 = {0.5, -9.5, 0.25}}};
    }
    emulator::WorldSample sample = images_.at(next_++ % images_.size());
    sample.t = t_image_;
    sample.t_sent = t_image_;
    t_image_ += next_ % 2 == 0 ? kInterval : Duration{};  // colour, then depth
    return sample;
  }

 private:
  emulator::ScriptedWorld script_;
  std::array<emulator::WorldSample, 4> images_;
  std::size_t next_ = 0;
  Duration t_imu_{};
  Duration t_image_{};
};

/// What came, and when the newest of each kind did.
class Watch final : public TransportSink {
 public:
  void on_frame(const RawFrame& frame) override {
    const auto index = static_cast<std::size_t>(frame.stream);
    heard.at(index) = frame.t_arrival;
    note_first(frame.t_arrival);
    const auto stamp = read_frame_stamp(frame.header);
    if (stamp && last_us_.at(index)) {
      const std::uint32_t step_us = stamp->t_us - *last_us_.at(index);  // over a wrap as well
      longest_step.at(index) =
          std::max<Duration>(longest_step.at(index), std::chrono::microseconds{step_us});
    }
    last_us_.at(index) = stamp ? std::optional{stamp->t_us} : std::nullopt;
    unstamped += stamp ? 0 : 1;
  }
  void on_imu(const RawImu& imu) override {
    note_first(imu.t_arrival);
    const bool is_accel = imu.reading.sensor == ImuSensor::kAccelerometer;
    heard.at(is_accel ? 2 : 3) = imu.t_arrival;
    most_accel = is_accel ? std::max(most_accel, to_si(imu.reading).norm()) : most_accel;
  }
  void on_damaged_frame(VideoStream /*stream*/, std::string_view why) override { damage = why; }
  void on_damaged_imu(std::string_view why) override { damage = why; }

  [[nodiscard]] bool all_since(HostTime t) const {
    return std::ranges::all_of(heard, [&](HostTime newest) { return newest >= t; });
  }

  std::array<HostTime, 4> heard{};  // depth, colour, accelerometer, gyroscope
  std::optional<HostTime> first;
  std::string damage;
  std::array<Duration, kVideoStreams> longest_step{};
  double most_accel = 0;
  int unstamped = 0;

 private:
  void note_first(HostTime t) { first = first.value_or(t); }

  std::array<std::optional<std::uint32_t>, kVideoStreams> last_us_{};
};

class FaultyCamera : public testing::Test {
 protected:
  void SetUp() override { log::set_level(log::Level::kError); }
  void TearDown() override { log::set_level(log::Level::kInfo); }

  void plug(const std::vector<std::string>& faults, const emulator::D435iOptions& options = {}) {
    std::vector<emulator::TimedFault> timed;
    for (const std::string& text : faults) {
      const auto fault = emulator::parse_fault(text);
      ASSERT_TRUE(fault) << fault.error().message;
      timed.push_back(*fault);
    }
    auto camera = emulator::D435i::create(options, std::make_unique<EndlessWorld>());
    ASSERT_TRUE(camera) << camera.error().message;
    camera_ = std::move(*camera);
    model_->device = std::make_unique<emulator::FaultyDevice>(*camera_, std::move(timed));
    const VideoMode mode{PixelCoding::kZ16, 424, 240, 30};
    VideoMode color = mode;
    color.coding = PixelCoding::kYuyv;
    session_ = std::make_unique<Session>(
        SessionOptions{.depth = mode, .color = color},
        [this](const std::string& /*serial*/) { return open(); }, watch_);
  }
  Result<std::unique_ptr<Transport>> open() {
    if (!model_->device->connected(model_->now)) {
      return fail(ErrorCode::kNotFound, "no D435i is connected");
    }
    return open_usb_transport(std::make_unique<ModelPort>(model_));
  }
  /// Steps until `done` or the limit; whether it is done.
  bool run_until(const std::function<bool()>& done, HostTime limit) {
    while (!done() && model_->now < limit) {
      model_->now += session_->step(model_->now, milliseconds{50});
    }
    return done();
  }
  void run_to(HostTime t) {
    run_until([] { return false; }, t);
  }
  /// Whether the session says that something is wrong.
  [[nodiscard]] bool trouble() const {
    return !session_->trouble().empty() || !session_->imu_trouble().empty() ||
           !watch_.damage.empty();
  }
  /// Runs until just before the first fault's start, all being well; that start.
  HostTime run_to_fault() {
    EXPECT_TRUE(run_until([this] { return watch_.first.has_value(); }, model_->now + seconds{1}));
    const HostTime start = watch_.first.value_or(model_->now) + kFaultStart;
    run_to(start - 2 * kImuInterval);
    EXPECT_FALSE(trouble()) << session_->trouble() << session_->imu_trouble() << watch_.damage;
    EXPECT_TRUE(watch_.all_since(start - milliseconds{100}));
    return start;
  }

  std::shared_ptr<PluggedModel> model_ = std::make_shared<PluggedModel>();
  std::unique_ptr<emulator::D435i> camera_;
  Watch watch_;
  std::unique_ptr<Session> session_;
};

/// One fault, and within what it must be said, and be over.
struct Row {
  std::string_view name;
  std::string_view fault;  ///< behind its name: when, how long, on what
  std::string_view says;   ///< part of what is said
  milliseconds seen;       ///< after its start
  milliseconds lasts;      ///< 0: until the host clears it
  milliseconds well;       ///< all streams run, after its end
};
std::ostream& operator<<(std::ostream& out, const Row& row) {
  return out << row.fault;
}

class CameraFault : public FaultyCamera, public testing::WithParamInterface<Row> {};

TEST_P(CameraFault, IsSaidInTimeAndOverInTime) {
  const Row& row = GetParam();
  plug({std::string{row.fault}});
  const HostTime start = run_to_fault();
  ASSERT_TRUE(run_until([this] { return trouble(); }, start + row.seen)) << "not seen in time";
  const Duration seen = model_->now - start;
  const std::string said = session_->trouble() + session_->imu_trouble() + watch_.damage;
  EXPECT_NE(said.find(row.says), std::string::npos) << said;
  const HostTime over = start + row.lasts;
  run_to(over);
  watch_.damage.clear();
  const auto well = [&] {
    return session_->trouble().empty() && session_->imu_trouble().empty() && watch_.all_since(over);
  };
  EXPECT_TRUE(run_until(well, over + row.well)) << "not well in time";
  const Duration took = model_->now - std::max(over, start);
  // And it stays so.
  run_to(model_->now + seconds{1});
  EXPECT_TRUE(well());
  EXPECT_TRUE(watch_.all_since(model_->now - milliseconds{100}));
  EXPECT_LT(watch_.most_accel, kMostAccel) << "a misread report was believed";
  const auto in_ms = [](Duration t) {
    return static_cast<int>(std::chrono::duration_cast<milliseconds>(t).count());
  };
  RecordProperty("seen_after_ms", in_ms(seen));
  RecordProperty("well_after_ms", in_ms(took));
}

// Ten frames without one are silence, a second without an IMU's sample is: d435i/core/session.cpp.
constexpr milliseconds kSilence{400};
constexpr milliseconds kImuSilence{1100};
constexpr milliseconds kOneFrame{40};

INSTANTIATE_TEST_SUITE_P(
    Each, CameraFault,
    testing::Values(
        Row{"unplug", "unplug@1+1", "unplugged", milliseconds{100}, milliseconds{1000},
            milliseconds{2000}},
        Row{"stall", "stall@1:depth", "halted", kOneFrame, milliseconds{0}, milliseconds{600}},
        Row{"stalledColour", "stall@1:color", "halted", kOneFrame, milliseconds{0},
            milliseconds{600}},
        Row{"broken", "broken@1+0.2:depth", "failed", kOneFrame, milliseconds{200}, kOneFrame},
        Row{"silentDepth", "silent@1+0.5:depth", "depth fell silent", kSilence, milliseconds{500},
            milliseconds{1600}},
        Row{"silentAll", "silent@1+3", "fell silent", kSilence, milliseconds{3000},
            milliseconds{1600}},
        // Long enough for all rungs: the last one takes the camera off the bus for four seconds.
        Row{"silentForLong", "silent@1+5", "fell silent", kSilence, milliseconds{5000},
            milliseconds{6500}},
        Row{"silentImu", "silent@1+1.5:imu", "silent", kImuSilence, milliseconds{1500},
            milliseconds{100}},
        Row{"shortFrames", "short@1+0.3:depth", "ended early", 2 * kOneFrame, milliseconds{300},
            2 * kOneFrame},
        Row{"badHeader", "bad-header@1+0.2:depth", "header", kOneFrame, milliseconds{200},
            2 * kOneFrame},
        Row{"errorBit", "error-bit@1+0.2:depth", "damaged", kOneFrame, milliseconds{200},
            2 * kOneFrame},
        Row{"shortReports", "short@1+0.2:imu", "report", milliseconds{10}, milliseconds{200},
            kOneFrame},
        Row{"otherLayout", "other-layout@1+0.3:imu", "layout", milliseconds{10}, milliseconds{300},
            kOneFrame}),
    [](const auto& row) { return std::string{row.param.name}; });

TEST_F(FaultyCamera, WithoutMetadataFramesKeepTheCamerasStamps) {
  plug({"no-metadata@1+0.5"});
  const HostTime start = run_to_fault();
  run_to(start + seconds{1});
  EXPECT_FALSE(trouble()) << watch_.damage;
  EXPECT_EQ(watch_.unstamped, 0);
  for (const Duration step : watch_.longest_step) {
    EXPECT_LT(step, 2 * kInterval);
  }
}

TEST_F(FaultyCamera, AClockThatWrapsIsNoEvent) {
  constexpr std::uint64_t kHalfASecondBefore = (std::uint64_t{1} << 32U) - 500'000;
  plug({}, {.clock_start_us = kHalfASecondBefore});
  run_to(run_to_fault() + seconds{1});
  EXPECT_FALSE(trouble()) << watch_.damage;
  for (const Duration step : watch_.longest_step) {
    EXPECT_NEAR(to_seconds(step), to_seconds(kInterval), 1e-3);
  }
}

TEST_F(FaultyCamera, CorruptPixelsUnderAGoodHeaderAreDelivered) {
  // Nothing on the bus tells them from good ones: the estimator's gates are for those.
  plug({"corrupt@1+0.3:depth"});
  const HostTime start = run_to_fault();
  run_to(start + milliseconds{300});
  EXPECT_FALSE(trouble()) << watch_.damage;
  EXPECT_TRUE(watch_.all_since(model_->now - milliseconds{100}));
}

TEST_F(FaultyCamera, AHundredReplugsEachAreTheSame) {
  constexpr int kCycles = 100;
  std::vector<std::string> faults;
  for (int i = 1; i <= kCycles; ++i) {
    faults.push_back("unplug@" + std::to_string(i) + "+0.5");
  }
  plug(faults);
  const HostTime start = run_to_fault();
  Duration slowest{};
  for (int i = 0; i < kCycles; ++i) {
    const HostTime gone = start + i * seconds{1};
    const HostTime back = gone + milliseconds{500};
    run_to(gone);
    ASSERT_TRUE(run_until([&] { return session_->state() == SessionState::kAway; },
                          gone + milliseconds{100}))
        << "cycle " << i;
    ASSERT_TRUE(run_until([&] { return watch_.all_since(back); }, back + milliseconds{500}))
        << "cycle " << i;
    slowest = std::max(slowest, model_->now - back);
  }
  EXPECT_EQ(session_->counters().losses, static_cast<std::uint64_t>(kCycles));
  EXPECT_LT(slowest, milliseconds{500});
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
