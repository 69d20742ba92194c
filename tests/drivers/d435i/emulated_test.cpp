#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/device/device.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/model_port.hpp"
#include "d435i/usb/usb_transport.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "d435i/uvc/metadata.hpp"
#include "d435i/uvc/payload.hpp"
#include "scripted_world.hpp"

// The driver above USB against the emulated camera: two readings of the same facts. Nothing of the
// one is code of the other.

namespace geoflow::drivers::d435i::tests {
namespace {

using emulator::ScriptedWorld;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kFrames = 30;
constexpr Duration kInterval = std::chrono::microseconds{33'333};  // a stream at 30 Hz takes each

/// What came, copied.
class Kept final : public TransportSink {
 public:
  struct Frame {
    emulator::Bytes pixels;
    emulator::Bytes header;
  };
  void on_frame(const RawFrame& frame) override {
    frames.at(static_cast<std::size_t>(frame.stream))
        .push_back({{frame.pixels.begin(), frame.pixels.end()},
                    {frame.header.begin(), frame.header.end()}});
  }
  void on_imu(const RawImu& sample) override { imu.push_back(sample.reading); }
  void on_damaged_frame(VideoStream /*stream*/, std::string_view why) override {
    damage.emplace_back(why);
  }
  void on_damaged_imu(std::string_view why) override { damage.emplace_back(why); }

  std::array<std::vector<Frame>, kVideoStreams> frames;
  std::vector<ImuReading> imu;
  std::vector<std::string> damage;
};

class EmulatedD435i : public testing::Test {
 protected:
  void plug(const emulator::D435iOptions& options = {}) {
    auto world = std::make_unique<ScriptedWorld>();
    world_calibration_ = world->calibration();
    for (int i = 1; i <= kFrames; ++i) {
      for (int j = 0; j < 7; ++j) {
        world->add_imu({.accel_mps2 = {0.5, -9.5, 0.25}, .gyro_radps = {0.1, -0.2, 0.3}},
                       (i - 1) * kInterval + milliseconds{5 * j});
      }
      world->add_images(static_cast<std::uint8_t>(i), i * kInterval);
    }
    auto device = emulator::D435i::create(options, std::move(world));
    ASSERT_TRUE(device) << device.error().message;
    model_->device = std::move(*device);
  }
  Result<std::unique_ptr<Transport>> open() {
    return open_usb_transport(std::make_unique<ModelPort>(model_));
  }
  void poll_for(Transport& transport, TransportSink& sink, Duration duration) {
    const HostTime end = model_->now + duration;
    while (model_->now < end) {
      ASSERT_TRUE(transport.poll(milliseconds{1}, sink));
    }
  }

  std::shared_ptr<PluggedModel> model_ = std::make_shared<PluggedModel>();
  Calibration world_calibration_;
};

TEST_F(EmulatedD435i, ShowsTheModesOfItsDescriptors) {
  plug();
  const auto transport = open();
  ASSERT_TRUE(transport) << transport.error().message;
  const LinkInfo& link = (*transport)->link();
  EXPECT_TRUE(link.super_speed);
  EXPECT_EQ(std::ranges::count(link.modes, PixelCoding::kZ16, &VideoMode::coding), 32);
  EXPECT_EQ(std::ranges::count(link.modes, PixelCoding::kYuyv, &VideoMode::coding), 32);
}

TEST_F(EmulatedD435i, ItsCalibrationIsThatOfTheWorld) {
  plug();
  const auto device = open_device({}, [&](const std::string& /*serial*/) { return open(); });
  ASSERT_TRUE(device) << device.error().message;
  const Calibration& calibration = (*device)->calibration();
  const CameraIntrinsics& expected = world_calibration_.camera;
  EXPECT_NEAR(calibration.camera.fx, expected.fx, 1e-3);
  EXPECT_NEAR(calibration.camera.fy, expected.fy, 1e-3);
  EXPECT_NEAR(calibration.camera.cx, expected.cx, 1e-3);
  EXPECT_NEAR(calibration.camera.cy, expected.cy, 1e-3);
  EXPECT_EQ(calibration.serial, "843112070435");
  ASSERT_TRUE(calibration.T_cam_imu && world_calibration_.T_cam_imu);
  const SE3 T_imu_imu = calibration.T_cam_imu->inverse() * *world_calibration_.T_cam_imu;
  EXPECT_LT(T_imu_imu.log().norm(), 1e-5);
}

TEST_F(EmulatedD435i, StreamsEveryByteOfDepth) {
  plug();
  const auto transport = open();
  ASSERT_TRUE(transport);
  ASSERT_TRUE((*transport)->start_video(VideoStream::kDepth, {PixelCoding::kZ16, 640, 480, 30}));
  ASSERT_TRUE((*transport)->start_video(VideoStream::kColor, {PixelCoding::kYuyv, 640, 480, 30}));
  Kept kept;
  poll_for(**transport, kept, seconds{2});
  EXPECT_TRUE(kept.damage.empty()) << kept.damage.front();
  const auto& depth = kept.frames[0];
  ASSERT_EQ(depth.size(), static_cast<std::size_t>(kFrames));
  EXPECT_EQ(kept.frames[1].size(), static_cast<std::size_t>(kFrames));
  std::optional<std::uint32_t> last_counter;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    ASSERT_EQ(depth[i].pixels, ScriptedWorld::pixels(static_cast<std::uint8_t>(i + 1), 2));
    const auto header = parse_payload_header(depth[i].header);
    ASSERT_TRUE(header && header->pts_us);
    const auto metadata = parse_metadata(header->metadata);
    ASSERT_TRUE(metadata) << metadata.error().message;
    ASSERT_TRUE(metadata->timing && metadata->timing->frame_counter);
    if (last_counter) {
      EXPECT_EQ(*metadata->timing->frame_counter, *last_counter + 1);
    }
    last_counter = metadata->timing->frame_counter;
    ASSERT_TRUE(metadata->configuration);
    EXPECT_EQ(metadata->configuration->width, 640);
    EXPECT_EQ(metadata->configuration->height, 480);
  }
}

TEST_F(EmulatedD435i, StreamsAgainAfterItWasStopped) {
  plug();
  const auto transport = open();
  ASSERT_TRUE(transport);
  Kept kept;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE((*transport)->start_video(VideoStream::kDepth, {PixelCoding::kZ16, 640, 480, 30}));
    const auto before = kept.frames[0].size();
    poll_for(**transport, kept, milliseconds{200});
    EXPECT_GT(kept.frames[0].size(), before) << "at start " << i;
    (*transport)->stop_video(VideoStream::kDepth);
  }
}

TEST_F(EmulatedD435i, TheImuSaysWhatItFeels) {
  for (const std::uint8_t minor : {std::uint8_t{12}, std::uint8_t{16}}) {
    plug({.firmware = {.major = 5, .minor = minor, .patch = 7, .build = 100}});
    const auto transport = open();
    ASSERT_TRUE(transport);
    ASSERT_TRUE((*transport)->start_imu(ImuSensor::kAccelerometer, 200));
    ASSERT_TRUE((*transport)->start_imu(ImuSensor::kGyroscope, 200));
    ASSERT_TRUE((*transport)->start_video(VideoStream::kDepth, {PixelCoding::kZ16, 640, 480, 30}));
    Kept kept;
    poll_for(**transport, kept, seconds{1});
    EXPECT_TRUE(kept.damage.empty()) << kept.damage.front();
    ASSERT_GT(kept.imu.size(), 100U);
    for (const ImuReading& reading : kept.imu) {
      EXPECT_EQ(reading.layout, minor < 16 ? ImuLayout::k16Bit : ImuLayout::k32Bit);
      const Vector3d value = to_si(reading);
      // Counts of 0.001 g, and of 0.1 or 0.0001 degrees a second.
      if (reading.sensor == ImuSensor::kAccelerometer) {
        EXPECT_NEAR(value.norm(), Vector3d(0.5, -9.5, 0.25).norm(), 0.01);
      } else {
        EXPECT_NEAR(value.norm(), Vector3d(0.1, -0.2, 0.3).norm(), minor < 16 ? 2e-3 : 2e-6);
      }
    }
  }
}

TEST_F(EmulatedD435i, TheWholeDeviceDeliversSamples) {
  class Sink final : public CameraSink, public ImuSink {
   public:
    void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
      color.push_back(frame.t_device);
    }
    void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
      depth.push_back(frame.t_device);
    }
    void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
      imu.push_back(sample.sample);
    }
    std::vector<DeviceTime<CameraClock>> color;
    std::vector<DeviceTime<CameraClock>> depth;
    std::vector<ImuSample> imu;
  } sink;
  model_->now = HostClock::now();  // by which the device watches over it
  plug();
  const auto device = open_device({}, [&](const std::string& /*serial*/) { return open(); });
  ASSERT_TRUE(device);
  ASSERT_TRUE((*device)->camera().start(sink));
  ASSERT_TRUE((*device)->imu()->start(sink));
  std::stop_source stop;
  // The model's time runs as it is polled: until all frames are there, or far beyond.
  const auto enough = [&] { return sink.depth.size() + sink.color.size() >= 2 * kFrames - 4; };
  std::jthread watcher{[&](const std::stop_token& done) {
    const HostTime limit = HostClock::now() + seconds{30};
    while (!done.stop_requested() && HostClock::now() < limit &&
           (*device)->status().depth_frames < kFrames) {
      std::this_thread::sleep_for(milliseconds{2});
    }
    stop.request_stop();
  }};
  (*device)->run(stop.get_token());
  watcher.join();
  EXPECT_TRUE(enough()) << sink.depth.size() << " and " << sink.color.size();
  ASSERT_FALSE(sink.imu.empty());
  // In the IMU frame of the calibration: what the world said, to the counts' rounding.
  EXPECT_NEAR(sink.imu.front().accel_mps2.norm(), Vector3d(0.5, -9.5, 0.25).norm(), 0.01);
  for (std::size_t i = 1; i < sink.depth.size(); ++i) {
    EXPECT_NEAR(to_seconds(sink.depth[i] - sink.depth[i - 1]), to_seconds(kInterval), 0.002);
  }
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
