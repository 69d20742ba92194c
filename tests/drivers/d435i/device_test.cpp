#include "d435i/device/device.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/bytes.hpp"
#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/device/samples.hpp"
#include "d435i/golden.hpp"
#include "d435i/imu/merge.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/pixels/registration.hpp"
#include "d435i/scripted_camera.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

class Received final : public CameraSink, public ImuSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override { color.push_back(frame); }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override { depth.push_back(frame); }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { imu.push_back(sample); }

  std::vector<Arrival<CameraClock, ColorFrame>> color;
  std::vector<Arrival<CameraClock, DepthFrame>> depth;
  std::vector<Arrival<ImuClock, ImuSample>> imu;
};

TEST(D435iDevice, ItsCalibrationIsTheCameras) {
  ScriptedCamera camera;
  const auto device = open_device({}, camera.opener());
  ASSERT_TRUE(device) << device.error().message;
  const Calibration& calibration = (*device)->calibration();
  EXPECT_EQ(calibration.serial, "831122070153");
  EXPECT_NEAR(calibration.camera.fx, 612.4, 1e-3);
  EXPECT_EQ(calibration.depth_unit_m, 1e-3);
  EXPECT_EQ(calibration.depth_alignment, DepthAlignment::kExact);
  // The IMU as drawn, seen from the colour camera: through the depth camera's frame.
  ASSERT_TRUE(calibration.T_cam_imu);
  const Vector3d p_depth_imu{0.00552, -0.0051, -0.01174};
  const SE3 T_depth_cam{Eigen::Quaterniond{(Matrix3d{} << 0.999956, -0.009402, -0.000683,  //
                                            0.009402, 0.999955, -0.000868,                 //
                                            0.000691, 0.000861, 0.999999)
                                               .finished()},
                        Vector3d{-0.01501, 0.00136, -0.00025}};
  const Vector3d p_cam_imu = T_depth_cam.inverse() * p_depth_imu;
  EXPECT_TRUE(calibration.T_cam_imu->translation().isApprox(p_cam_imu, 1e-4))
      << calibration.T_cam_imu->translation().transpose();
}

TEST(D435iDevice, AFirmwareThatIsBusyIsAskedAgain) {
  ScriptedCamera camera;
  camera.busy_answers = 20;
  EXPECT_TRUE(open_device({}, camera.opener()));
  camera.busy_answers = 1000;
  const auto never = open_device({}, camera.opener());
  ASSERT_FALSE(never);
  EXPECT_EQ(never.error().code, ErrorCode::kUnavailable);
}

TEST(D435iDevice, TheFirmwaresIntrinsicsGoBeforeTheTables) {
  ScriptedCamera camera;
  camera.resolution_list = Builder{}.u16(640).u16(480).f32s({400, 401, 320, 240}).get();
  EXPECT_TRUE(open_device({}, camera.opener()));
  camera.tables.erase(25);
  const auto without = open_device({}, camera.opener());
  ASSERT_FALSE(without);
  EXPECT_NE(without.error().message.find("no data"), std::string::npos);
}

TEST(D435iDevice, RunsUntilItIsStopped) {
  ScriptedCamera camera;
  camera.now = HostClock::now();
  auto device = open_device({.color_as_gray = true}, camera.opener());
  ASSERT_TRUE(device) << device.error().message;
  Received received;
  ASSERT_TRUE((*device)->camera().start(received));
  ASSERT_TRUE((*device)->imu()->start(received));
  {
    std::jthread runner{[&](const std::stop_token& stop) { (*device)->run(stop); }};
    const HostTime limit = HostClock::now() + std::chrono::seconds{20};
    while ((*device)->status().depth_frames < 20 && HostClock::now() < limit) {
      std::this_thread::sleep_for(milliseconds{1});
    }
  }
  (*device)->camera().stop();
  EXPECT_GE(received.depth.size(), 20U);
  EXPECT_GE(received.color.size(), 19U);
  EXPECT_GT(received.imu.size(), 100U);
  EXPECT_EQ(received.color.front().sample.image.shape().format, PixelFormat::kGray8);
  const auto status = (*device)->status();
  EXPECT_FALSE(status.streaming);  // it was stopped
  EXPECT_EQ(status.firmware, "5.12.7.100");
}

/// A maker for a camera whose depth and colour are one, fed by hand.
class SampleMakerTest : public testing::Test {
 protected:
  static DepthRegistration registration() {
    const CameraIntrinsics camera{
        .width = 4, .height = 2, .fx = 10, .fy = 10, .cx = 1.5, .cy = 0.5};
    auto made = DepthRegistration::create({.depth = camera, .color = camera, .T_cam_depth = {}});
    return std::move(*made);
  }
  void SetUp() override {
    ASSERT_TRUE(maker_.camera().start(received_));
    ASSERT_TRUE(maker_.imu().start(received_));
  }
  void send_depth(std::span<const std::byte> header, HostTime t) {
    const Bytes pixels = from_hex("e803e803e803e803 e803e803e803e803");
    maker_.on_frame(
        {.stream = VideoStream::kDepth, .pixels = pixels, .header = header, .t_arrival = t});
  }
  void send_imu(ImuSensor sensor, std::uint32_t t_us, int y) {
    maker_.on_imu({.reading = {.sensor = sensor, .t_device_us = t_us, .counts = {0, y, 0}},
                   .t_arrival = HostTime{microseconds{t_us}}});
  }

  Received received_;
  SampleMaker maker_{registration(),
                     {4, 2, PixelFormat::kBgr8},
                     ImuTable{},
                     {.domain = StampDomain::kDevice, .wrap = kClockWrap}};
};

TEST_F(SampleMakerTest, AFrameIsStampedInTheMiddleOfItsExposure) {
  send_depth(golden_depth_header(1'000'000, 1), HostTime{milliseconds{5}});
  ASSERT_EQ(received_.depth.size(), 1U);
  EXPECT_EQ(received_.depth[0].t_device.time_since_epoch(), microseconds{1'000'000 - 4250});
  EXPECT_EQ(received_.depth[0].t_arrival, HostTime{milliseconds{5}});
  EXPECT_EQ(received_.depth[0].sample.image.row<std::uint16_t>(1)[2], 1000);
}

TEST_F(SampleMakerTest, StampsWrapAsTheCameraCounts) {
  send_depth(golden_depth_header(4000, 1), HostTime{milliseconds{5}});
  ASSERT_EQ(received_.depth.size(), 1U);
  EXPECT_EQ(received_.depth[0].t_device.time_since_epoch(), kClockWrap - microseconds{250});
}

TEST_F(SampleMakerTest, AFrameWithoutHeaderIsStampedByItsArrival) {
  const Bytes header = golden_depth_header(1'000'000, 1);
  send_depth(header, HostTime{milliseconds{500}});
  send_depth({}, HostTime{milliseconds{533}});
  send_depth(from_hex("02 80"), HostTime{milliseconds{566}});
  ASSERT_EQ(received_.depth.size(), 3U);
  EXPECT_EQ(received_.depth[1].t_device - received_.depth[0].t_device, milliseconds{33});
  EXPECT_EQ(received_.depth[2].t_device - received_.depth[0].t_device, milliseconds{66});
  EXPECT_EQ(maker_.stamped_by_arrival(), 2U);
}

TEST_F(SampleMakerTest, TheCamerasCounterTellsMissedFrames) {
  for (const std::uint32_t counter : {7U, 8U, 11U, 12U}) {
    send_depth(golden_depth_header(counter * 33'333, counter), HostTime{milliseconds{counter}});
  }
  EXPECT_EQ(maker_.missed_frames(), 2U);
  maker_.forget_counters();
  send_depth(golden_depth_header(1, 1), HostTime{milliseconds{99}});
  EXPECT_EQ(maker_.missed_frames(), 2U);
}

TEST_F(SampleMakerTest, AFrameOfAnotherSizeIsRejected) {
  const Bytes pixels(15);
  maker_.on_frame({.stream = VideoStream::kDepth, .pixels = pixels, .t_arrival = HostTime{}});
  maker_.on_frame({.stream = VideoStream::kColor, .pixels = pixels, .t_arrival = HostTime{}});
  EXPECT_TRUE(received_.depth.empty());
  EXPECT_TRUE(received_.color.empty());
  EXPECT_EQ(maker_.camera().health().rejected, 2U);
  EXPECT_EQ(maker_.camera().health().state, SourceState::kDegraded);
}

TEST_F(SampleMakerTest, FramesAreDroppedWhileAllBuffersAreHeld) {
  for (int i = 0; i < 50; ++i) {
    send_depth({}, HostTime{milliseconds{i}});
  }
  EXPECT_EQ(received_.depth.size() + maker_.camera().health().dropped, 50U);
  EXPECT_GT(maker_.camera().health().dropped, 0U);
  const auto held = received_.depth.size();
  received_.depth.clear();
  send_depth({}, HostTime{milliseconds{51}});
  EXPECT_EQ(received_.depth.size(), 1U);
  EXPECT_EQ(held, 48U);
}

TEST_F(SampleMakerTest, AccelerationIsInterpolatedAtTheGyroscopesTimes) {
  const std::uint32_t wrap = 0xffffffffU - 2'499;  // the clock wraps between the two
  send_imu(ImuSensor::kAccelerometer, wrap, -1000);
  send_imu(ImuSensor::kGyroscope, wrap + 2500, 0);
  EXPECT_TRUE(received_.imu.empty());  // the acceleration after it is to come
  send_imu(ImuSensor::kAccelerometer, wrap + 10'000, -2000);
  ASSERT_EQ(received_.imu.size(), 1U);
  EXPECT_NEAR(received_.imu[0].sample.accel_mps2.y(), -1.25 * 9.80665, 1e-9);
  EXPECT_EQ(received_.imu[0].t_device.time_since_epoch(), microseconds{0});
}

TEST_F(SampleMakerTest, AcrossAGapOfTheAccelerometerThereIsNoSample) {
  send_imu(ImuSensor::kAccelerometer, 0, -1000);
  send_imu(ImuSensor::kGyroscope, 100'000, 0);
  send_imu(ImuSensor::kAccelerometer, 200'000, -1000);
  EXPECT_TRUE(received_.imu.empty());
  EXPECT_EQ(maker_.imu_unpaired(), 1U);
  send_imu(ImuSensor::kAccelerometer, 210'000, -1000);
  send_imu(ImuSensor::kGyroscope, 205'000, 0);
  EXPECT_EQ(received_.imu.size(), 1U);
}

TEST_F(SampleMakerTest, NoImuSampleIsLostWhereBothSensorsAreReadInBatches) {
  constexpr int kBatch = 20;
  constexpr std::uint32_t kStep_us = 5'000;
  for (std::uint32_t begin = 0; begin < 5 * kBatch; begin += kBatch) {
    for (std::uint32_t i = begin; i < begin + kBatch; ++i) {
      send_imu(ImuSensor::kAccelerometer, i * kStep_us, -static_cast<int>(i));
    }
    for (std::uint32_t i = begin; i < begin + kBatch; ++i) {
      send_imu(ImuSensor::kGyroscope, i * kStep_us + kStep_us / 2, 0);
    }
  }
  // All but the last one, whose acceleration is to come.
  ASSERT_EQ(received_.imu.size(), 5U * kBatch - 1);
  EXPECT_EQ(maker_.imu_unpaired(), 0U);
  for (std::size_t i = 0; i < received_.imu.size(); ++i) {
    const double between = static_cast<double>(i) + 0.5;
    EXPECT_NEAR(received_.imu[i].sample.accel_mps2.y(), -between * 9.80665e-3, 1e-9);
  }
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
