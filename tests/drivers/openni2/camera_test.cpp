#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <OpenNI.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "openni2/scripted_scene.hpp"

namespace geoflow::drivers::openni2::tests {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

const std::string kUri = std::string{"d435i/"} + kSerial;
constexpr std::size_t kPixels = std::size_t{640} * 480;

class CountingSink final : public CameraSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    EXPECT_EQ(frame.sample.image.shape(), (ImageShape{640, 480, PixelFormat::kBgr8}));
    ++color;
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    EXPECT_EQ(frame.sample.image.shape(), (ImageShape{640, 480, PixelFormat::kDepth16}));
    EXPECT_GT(frame.t_device, last);
    last = frame.t_device;
    ++depth;
  }
  std::atomic<int> color{0};
  std::atomic<int> depth{0};
  DeviceTime<CameraClock> last = DeviceTime<CameraClock>::min();
};

/// Runs the camera until both streams have given so many frames.
void run_for(LiveCamera& camera, CountingSink& sink, int frames) {
  ASSERT_TRUE(camera.camera().start(sink));
  {
    std::jthread runner{[&](const std::stop_token& stop) { camera.run(stop); }};
    const HostTime limit = HostClock::now() + seconds{60};
    while ((sink.color < frames || sink.depth < frames) && HostClock::now() < limit) {
      std::this_thread::sleep_for(milliseconds{5});
    }
  }
  camera.camera().stop();
  EXPECT_GE(sink.color, frames);
  EXPECT_GE(sink.depth, frames);
}

TEST(OpenNi2Camera, AnyDeviceIsACamera) {
  const auto camera = open_openni2_camera({.uri = kUri});
  ASSERT_TRUE(camera) << camera.error().message;
  // The golden colour camera: fx 612.4 px at 640x480; its centre OpenNI does not tell.
  const Calibration& calibration = (*camera)->calibration();
  EXPECT_NEAR(calibration.camera.fx, 612.4, 0.1);
  EXPECT_EQ(calibration.camera.cx, 319.5);
  EXPECT_EQ(calibration.depth_unit_m, 1e-3);
  EXPECT_EQ((*camera)->imu(), nullptr);
  CountingSink sink;
  run_for(**camera, sink, 5);
  EXPECT_EQ((*camera)->camera().health().rejected, 0U);
}

TEST(OpenNi2Camera, WhatCannotBeIsAnError) {
  EXPECT_THAT(open_openni2_camera({.uri = "d435i/000000000000"}).error().message,
              HasSubstr("cannot open d435i/000000000000"));
  const auto mode = open_openni2_camera({.uri = kUri, .width = 641});
  ASSERT_FALSE(mode);
  EXPECT_THAT(mode.error().message, HasSubstr("no depth of 641x480 at 30 Hz"));
  EXPECT_THAT(mode.error().message, HasSubstr("848x480 at 30 Hz"));
}

/// A file of the scripted camera, made by OpenNI's own recorder.
class OniOfTheModule : public testing::Test {
 protected:
  void SetUp() override {
    using openni::OpenNI;
    ASSERT_EQ(OpenNI::initialize(), openni::STATUS_OK);
    openni::Device device;
    ASSERT_EQ(device.open(kUri.c_str()), openni::STATUS_OK) << OpenNI::getExtendedError();
    openni::VideoStream depth;
    openni::VideoStream color;
    openni::Recorder recorder;
    ASSERT_EQ(depth.create(device, openni::SENSOR_DEPTH), openni::STATUS_OK);
    ASSERT_EQ(color.create(device, openni::SENSOR_COLOR), openni::STATUS_OK);
    ASSERT_EQ(recorder.create(path_.c_str()), openni::STATUS_OK);
    ASSERT_EQ(recorder.attach(depth), openni::STATUS_OK);
    ASSERT_EQ(recorder.attach(color), openni::STATUS_OK);
    ASSERT_EQ(recorder.start(), openni::STATUS_OK);
    ASSERT_EQ(depth.start(), openni::STATUS_OK) << OpenNI::getExtendedError();
    ASSERT_EQ(color.start(), openni::STATUS_OK) << OpenNI::getExtendedError();
    openni::VideoFrameRef frame;
    for (int i = 0; i < 20; ++i) {
      ASSERT_EQ(depth.readFrame(&frame), openni::STATUS_OK);
      ASSERT_EQ(color.readFrame(&frame), openni::STATUS_OK);
    }
    frame.release();
    depth.stop();
    color.stop();
    recorder.stop();
    recorder.destroy();
    depth.destroy();
    color.destroy();
    device.close();
    OpenNI::shutdown();
  }

  geoflow::tests::TemporaryDirectory folder_;
  std::filesystem::path path_ = folder_.path() / "scripted.oni";
};

TEST_F(OniOfTheModule, IsARecordingPixelByPixel) {
  class Sink final : public CameraSink {
   public:
    void on_color(const Arrival<CameraClock, ColorFrame>& /*frame*/) override { ++color; }
    void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
      const auto* const pixels = frame.sample.image.row<std::uint16_t>(0);
      std::uint32_t number = 0;
      while (number < kDepthPeriod && depth_mm(number, 0) != pixels[0]) {
        ++number;
      }
      std::size_t different = 0;
      for (std::size_t i = 0; i < kPixels; ++i) {
        different += pixels[i] != depth_mm(number, i) ? 1U : 0U;
      }
      EXPECT_EQ(different, 0U) << "depth frame " << depth;
      ++depth;
    }
    int color = 0;
    int depth = 0;
  } sink;
  auto streams = RecordedStreams::open({.path = path_});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->info().format, "oni");
  EXPECT_EQ((*streams)->calibration().camera.width, 640);
  EXPECT_NEAR((*streams)->calibration().camera.fx, 612.4, 0.1);
  ASSERT_TRUE((*streams)->camera().start(sink));
  for (auto more = (*streams)->step(); !more || *more; more = (*streams)->step()) {
    ASSERT_TRUE(more) << more.error().message;
  }
  EXPECT_GE(sink.color, 15);
  EXPECT_GE(sink.depth, 15);
}

TEST_F(OniOfTheModule, PlaysThroughOpenNiAsACamera) {
  const auto camera = open_openni2_camera({.uri = path_.string()});
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_NEAR((*camera)->calibration().camera.fx, 612.4, 0.1);
  CountingSink sink;
  ASSERT_TRUE((*camera)->camera().start(sink));
  (*camera)->run({});  // to its end: it plays once
  (*camera)->camera().stop();
  EXPECT_GT(sink.color, 5);
  EXPECT_GT(sink.depth, 5);
}

TEST(OniFiles, ThatAreDamagedAreRefusedBeforeOpenNiGetsThem) {
  const geoflow::tests::TemporaryDirectory folder;
  const auto path = folder.path() / "damaged.oni";
  std::ofstream{path, std::ios::binary} << "NI10" << std::string(100, 'x');
  const auto camera = open_openni2_camera({.uri = path.string()});
  ASSERT_FALSE(camera);
  EXPECT_THAT(camera.error().message, HasSubstr("damaged.oni: byte 24"));
}

}  // namespace
}  // namespace geoflow::drivers::openni2::tests
