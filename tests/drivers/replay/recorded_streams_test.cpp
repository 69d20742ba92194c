#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::at_ms;
using tests::drain;
using tests::message_of;
using tests::Recorder;

TEST(RecordedStreams, StepsThroughAKinectRecording) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  auto streams = RecordedStreams::open({.path = path, .color_as_gray = true});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre());
  ASSERT_EQ(recorder.colors.size(), 400U);
  EXPECT_EQ(recorder.depths.size(), 400U);
  EXPECT_EQ(recorder.colors.front().sample.image.shape(),
            (ImageShape{.width = 640, .height = 480, .format = PixelFormat::kGray8}));
  EXPECT_EQ((*streams)->imu(), nullptr);
  EXPECT_EQ((*streams)->now(), (*streams)->info().end);
  EXPECT_EQ((*streams)->decode_statistics().images, 800U);
  EXPECT_GT((*streams)->decode_statistics().total, Duration{});
  EXPECT_DOUBLE_EQ((*streams)->calibration().depth_unit_m, 1.0 / 5000);
}

class RecordedStreamsTest : public testing::Test {
 protected:
  void open(int frames, std::size_t prefetch = 8) {
    tests::write_tum(directory_.path(), frames);
    auto opened = RecordedStreams::open({.path = directory_.path(), .prefetch = prefetch});
    ASSERT_TRUE(opened) << opened.error().message;
    streams_ = *std::move(opened);
  }
  TemporaryDirectory directory_;
  std::unique_ptr<RecordedStreams> streams_;
  Recorder recorder_;
};

TEST_F(RecordedStreamsTest, StepIsItsOwnClock) {
  open(2);
  ASSERT_TRUE(streams_->camera().start(recorder_));
  EXPECT_EQ(streams_->now(), at_ms(100000));
  EXPECT_TRUE(*streams_->step());
  EXPECT_TRUE(*streams_->step());
  EXPECT_EQ(streams_->now(), at_ms(100001));
  EXPECT_EQ(streams_->to_recording_time(at_ms(5)), at_ms(5));
  drain(*streams_);
  EXPECT_FALSE(*streams_->step());
  EXPECT_FALSE(*streams_->step());
  EXPECT_EQ(streams_->camera().health().state, SourceState::kStopped);
  EXPECT_THAT(streams_->camera().health().reason, HasSubstr("ended"));
}

TEST_F(RecordedStreamsTest, DeliversOnlyBetweenStartAndStop) {
  open(4);
  EXPECT_TRUE(*streams_->step());
  EXPECT_EQ(recorder_.order, "");
  ASSERT_TRUE(streams_->camera().start(recorder_));
  EXPECT_FALSE(streams_->camera().start(recorder_));
  EXPECT_TRUE(*streams_->step());
  EXPECT_TRUE(*streams_->step());
  streams_->camera().stop();
  streams_->camera().stop();
  EXPECT_TRUE(*streams_->step());
  EXPECT_EQ(recorder_.order, "dc");
  EXPECT_EQ(streams_->camera().health().delivered, 2U);
  EXPECT_EQ(streams_->camera().health().state, SourceState::kStopped);
}

TEST_F(RecordedStreamsTest, OrderDoesNotDependOnThePrefetch) {
  for (const std::size_t prefetch : {0U, 1U, 3U, 100U}) {
    Recorder recorder;
    open(20, prefetch);
    ASSERT_TRUE(streams_->camera().start(recorder));
    EXPECT_THAT(drain(*streams_), ElementsAre());
    ASSERT_EQ(recorder.colors.size(), 20U);
    for (std::size_t i = 0; i < 20; ++i) {
      EXPECT_EQ(recorder.colors[i].sample.image.row<std::uint8_t>(0)[0], i);
    }
  }
}

TEST_F(RecordedStreamsTest, NeverDropsForASlowConsumer) {
  open(150);
  ASSERT_TRUE(streams_->camera().start(recorder_));  // keeps every frame
  EXPECT_THAT(drain(*streams_), ElementsAre());
  EXPECT_EQ(recorder_.colors.size(), 150U);
  EXPECT_EQ(recorder_.colors[0].sample.image.row<std::uint8_t>(0)[0], 0);
  EXPECT_EQ(streams_->camera().health().dropped, 0U);
}

TEST_F(RecordedStreamsTest, ClosesWhileSamplesWait) {
  open(30);
  EXPECT_TRUE(*streams_->step());
  streams_.reset();
}

TEST_F(RecordedStreamsTest, PlaysInStepWithTheClock) {
  constexpr double kSpeed = 4;
  open(10);
  ASSERT_TRUE(streams_->camera().start(recorder_));
  const HostTime begin = HostClock::now();
  ASSERT_TRUE(streams_->play({}, kSpeed));
  const Duration took = HostClock::now() - begin;
  // 9 frames at 30 Hz, four times as fast.
  EXPECT_GE(took, milliseconds{75});
  ASSERT_EQ(recorder_.order.size(), 20U);
  EXPECT_GE(recorder_.arrivals.front(), begin);
  EXPECT_EQ(recorder_.colors[9].t_arrival - recorder_.colors[0].t_arrival, milliseconds{300});
  EXPECT_EQ(recorder_.colors[9].t_device.time_since_epoch(),
            recorder_.colors[9].t_arrival.time_since_epoch());
  EXPECT_EQ(streams_->to_recording_time(recorder_.colors[9].t_arrival), at_ms(100300));
  EXPECT_EQ(streams_->now(), recorder_.arrivals.back());
}

TEST_F(RecordedStreamsTest, PlayKeepsCountOfRejectedSamples) {
  open(4);
  tests::write_text(directory_.path() / "rgb/1.png", "broken");
  auto reopened = RecordedStreams::open({.path = directory_.path()});
  ASSERT_TRUE(reopened);
  ASSERT_TRUE((*reopened)->camera().start(recorder_));
  ASSERT_TRUE((*reopened)->play({}, 100));
  EXPECT_EQ(recorder_.order, "cddcdcd");
  EXPECT_THAT((*reopened)->recent_errors(), ElementsAre(HasSubstr("rgb.txt:4: rgb/1.png")));
  EXPECT_EQ((*reopened)->camera().health().rejected, 1U);
}

TEST_F(RecordedStreamsTest, RefusesASpeedThatIsNone) {
  open(1);
  for (const double speed : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    EXPECT_THAT(message_of(streams_->play({}, speed)), HasSubstr("speed"));
  }
}

TEST_F(RecordedStreamsTest, AStopInterruptsTheWait) {
  open(2);
  ASSERT_TRUE(streams_->camera().start(recorder_));
  std::stop_source stop;
  const HostTime begin = HostClock::now();
  const std::jthread stopper{[&] {
    std::this_thread::sleep_for(milliseconds{50});
    stop.request_stop();
  }};
  // The second frame is due after 33 s.
  ASSERT_TRUE(streams_->play(stop.get_token(), 1e-3));
  EXPECT_LT(HostClock::now() - begin, std::chrono::seconds{10});
  EXPECT_LT(recorder_.order.size(), 4U);
  // What was waited for is not lost.
  drain(*streams_);
  EXPECT_EQ(recorder_.order, "cdcd");
}

TEST_F(RecordedStreamsTest, PortsMayBeStoppedFromAnotherThread) {
  open(100);
  std::atomic<bool> stopped = false;
  struct Watcher final : CameraSink {
    explicit Watcher(const std::atomic<bool>& flag) : stopped{flag} {}
    void on_color(const Arrival<CameraClock, ColorFrame>& /*frame*/) override {
      EXPECT_FALSE(stopped);
    }
    void on_depth(const Arrival<CameraClock, DepthFrame>& /*frame*/) override {
      EXPECT_FALSE(stopped);
    }
    const std::atomic<bool>& stopped;
  } watcher{stopped};
  ASSERT_TRUE(streams_->camera().start(watcher));
  const std::jthread stopper{[&] {
    while (streams_->camera().health().delivered < 20) {
      std::this_thread::yield();
    }
    streams_->camera().stop();
    stopped = true;
  }};
  EXPECT_THAT(drain(*streams_), ElementsAre());
}

}  // namespace
}  // namespace geoflow::drivers
