#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <OpenNI.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/image.hpp"
#include "tests/support/data.hpp"

#include "d435i/pixels/yuyv.hpp"
#include "openni2/scripted_scene.hpp"

namespace geoflow::drivers::openni2::tests {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;
const std::string kUri = std::string{"d435i/"} + kSerial;

/// Debian's libOpenNI2 with the module of the scripted camera.
class OpenNi2Module : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    ASSERT_EQ(openni::OpenNI::initialize(), openni::STATUS_OK)
        << openni::OpenNI::getExtendedError();
  }
  static void TearDownTestSuite() { openni::OpenNI::shutdown(); }
  void SetUp() override {
    ASSERT_EQ(device_.open(kUri.c_str()), openni::STATUS_OK) << openni::OpenNI::getExtendedError();
  }
  void TearDown() override {
    depth_.destroy();
    color_.destroy();
    device_.close();
  }
  void start(openni::VideoStream& stream, openni::SensorType type, openni::PixelFormat format) {
    ASSERT_EQ(stream.create(device_, type), openni::STATUS_OK)
        << openni::OpenNI::getExtendedError();
    openni::VideoMode mode;
    mode.setResolution(kWidth, kHeight);
    mode.setFps(30);
    mode.setPixelFormat(format);
    ASSERT_EQ(stream.setVideoMode(mode), openni::STATUS_OK);
    ASSERT_EQ(stream.start(), openni::STATUS_OK) << openni::OpenNI::getExtendedError();
  }
  /// The next frame; empty where none comes for long.
  static openni::VideoFrameRef next(openni::VideoStream& stream) {
    constexpr int kPatience_ms = 20'000;
    openni::VideoStream* waited = &stream;
    int which = -1;
    openni::VideoFrameRef frame;
    if (openni::OpenNI::waitForAnyStream(&waited, 1, &which, kPatience_ms) == openni::STATUS_OK) {
      EXPECT_EQ(stream.readFrame(&frame), openni::STATUS_OK);
    }
    return frame;
  }

  openni::Device device_;
  openni::VideoStream depth_;
  openni::VideoStream color_;
};

/// The number of the frame with this first depth.
std::uint32_t number_of(std::uint16_t first_mm) {
  std::uint32_t number = 0;
  while (number < kDepthPeriod && depth_mm(number, 0) != first_mm) {
    ++number;
  }
  return number;
}

void expect_depth(const openni::VideoFrameRef& frame, std::uint32_t number) {
  const auto* const depth = static_cast<const std::uint16_t*>(frame.getData());
  std::size_t different = 0;
  for (std::size_t i = 0; i < kPixels; ++i) {
    different += depth[i] != depth_mm(number, i) ? 1U : 0U;
  }
  EXPECT_EQ(different, 0U) << "frame " << number;
}

std::vector<std::byte> yuyv_image(std::uint32_t number) {
  std::vector<std::byte> bytes(2 * kPixels);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(yuyv_byte(number, i));
  }
  return bytes;
}

TEST_F(OpenNi2Module, IsListedAndSaysWhatItIs) {
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  ASSERT_EQ(devices.getSize(), 1);
  EXPECT_EQ(devices[0].getUri(), kUri);
  EXPECT_EQ(devices[0].getUsbVendorId(), 0x8086);
  EXPECT_EQ(devices[0].getUsbProductId(), 0x0b3a);
  std::array<char, 64> text{};
  int size = text.size();
  ASSERT_EQ(device_.getProperty(openni::DEVICE_PROPERTY_FIRMWARE_VERSION, text.data(), &size),
            openni::STATUS_OK);
  EXPECT_STREQ(text.data(), "5.12.7.100");
  const auto* depth = device_.getSensorInfo(openni::SENSOR_DEPTH);
  ASSERT_NE(depth, nullptr);
  EXPECT_GT(depth->getSupportedVideoModes().getSize(), 10);
  EXPECT_EQ(device_.getSensorInfo(openni::SENSOR_IR), nullptr);
}

TEST_F(OpenNi2Module, DepthIsTheCamerasPixelByPixel) {
  start(depth_, openni::SENSOR_DEPTH, openni::PIXEL_FORMAT_DEPTH_1_MM);
  EXPECT_EQ(depth_.getMaxPixelValue(), 10'000);
  std::uint64_t last_us = 0;
  for (int i = 0; i < 5; ++i) {
    const auto frame = next(depth_);
    ASSERT_TRUE(frame.isValid());
    ASSERT_EQ(frame.getWidth(), kWidth);
    ASSERT_EQ(frame.getHeight(), kHeight);
    ASSERT_EQ(frame.getStrideInBytes(), 2 * kWidth);
    const auto number = number_of(*static_cast<const std::uint16_t*>(frame.getData()));
    expect_depth(frame, number);
    EXPECT_GT(frame.getTimestamp(), last_us);
    last_us = frame.getTimestamp();
  }
}

TEST_F(OpenNi2Module, ColourIsTheCamerasPixelByPixel) {
  start(color_, openni::SENSOR_COLOR, openni::PIXEL_FORMAT_YUYV);
  const auto frame = next(color_);
  ASSERT_TRUE(frame.isValid());
  ASSERT_EQ(frame.getDataSize(), static_cast<int>(2 * kPixels));
  const auto* const bytes = static_cast<const std::byte*>(frame.getData());
  const auto number = static_cast<std::uint8_t>(std::to_integer<int>(bytes[0]) - yuyv_byte(0, 0));
  EXPECT_EQ(std::memcmp(bytes, yuyv_image(number).data(), 2 * kPixels), 0);

  color_.destroy();
  start(color_, openni::SENSOR_COLOR, openni::PIXEL_FORMAT_RGB888);
  const auto rgb = next(color_);
  ASSERT_TRUE(rgb.isValid());
  ASSERT_EQ(rgb.getDataSize(), static_cast<int>(3 * kPixels));
  // Which frame it is, the first pixels tell: only one of the 256 has them.
  int found = 0;
  for (std::uint32_t candidate = 0; candidate < 256; ++candidate) {
    std::vector<std::byte> expected(3 * kPixels);
    const ImageShape shape{kWidth, kHeight, PixelFormat::kRgb8};
    ASSERT_TRUE(d435i::convert_yuyv(yuyv_image(candidate), shape, expected));
    found += std::memcmp(rgb.getData(), expected.data(), expected.size()) == 0 ? 1 : 0;
  }
  EXPECT_EQ(found, 1);
}

TEST_F(OpenNi2Module, BothStreamsComeInPairs) {
  start(depth_, openni::SENSOR_DEPTH, openni::PIXEL_FORMAT_DEPTH_1_MM);
  start(color_, openni::SENSOR_COLOR, openni::PIXEL_FORMAT_RGB888);
  ASSERT_EQ(device_.setDepthColorSyncEnabled(true), openni::STATUS_OK)
      << openni::OpenNI::getExtendedError();
  for (int i = 0; i < 5; ++i) {
    const auto depth = next(depth_);
    const auto color = next(color_);
    ASSERT_TRUE(depth.isValid());
    ASSERT_TRUE(color.isValid());
    EXPECT_EQ(depth.getFrameIndex(), color.getFrameIndex());
    const auto apart_us =
        static_cast<double>(depth.getTimestamp()) - static_cast<double>(color.getTimestamp());
    EXPECT_LT(std::abs(apart_us), 17'000);
  }
  // One goes on while the other ends.
  color_.stop();
  EXPECT_TRUE(next(depth_).isValid());
}

TEST_F(OpenNi2Module, RegistersDepthToColourWhereAsked) {
  ASSERT_TRUE(device_.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR));
  ASSERT_EQ(device_.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR),
            openni::STATUS_OK);
  start(depth_, openni::SENSOR_DEPTH, openni::PIXEL_FORMAT_DEPTH_1_MM);
  // The golden colour camera: fx 612.4 px at 640.
  EXPECT_NEAR(depth_.getHorizontalFieldOfView(), 2 * std::atan(320 / 612.4), 1e-3);
  const auto registered = next(depth_);
  ASSERT_TRUE(registered.isValid());
  ASSERT_EQ(device_.setImageRegistrationMode(openni::IMAGE_REGISTRATION_OFF), openni::STATUS_OK);
  EXPECT_GT(
      std::abs(static_cast<double>(depth_.getHorizontalFieldOfView()) - 2 * std::atan(320 / 612.4)),
      0.01);
  openni::VideoFrameRef raw;
  std::uint32_t number = kDepthPeriod;
  for (int i = 0; i < 3; ++i) {  // one that was under way may still be registered
    raw = next(depth_);
    ASSERT_TRUE(raw.isValid());
    number = number_of(*static_cast<const std::uint16_t*>(raw.getData()));
  }
  expect_depth(raw, number);
}

TEST_F(OpenNi2Module, PointsOfDepthAreFoundInColour) {
  ASSERT_EQ(depth_.create(device_, openni::SENSOR_DEPTH), openni::STATUS_OK);
  ASSERT_EQ(color_.create(device_, openni::SENSOR_COLOR), openni::STATUS_OK);
  int near_x = 0;
  int near_y = 0;
  int far_x = 0;
  int far_y = 0;
  using openni::CoordinateConverter;
  ASSERT_EQ(CoordinateConverter::convertDepthToColor(depth_, color_, 320, 240,
                                                     openni::DepthPixel{400}, &near_x, &near_y),
            openni::STATUS_OK);
  ASSERT_EQ(CoordinateConverter::convertDepthToColor(depth_, color_, 320, 240,
                                                     openni::DepthPixel{8000}, &far_x, &far_y),
            openni::STATUS_OK);
  // The cameras are 15 mm apart: 612.4 px * 15 mm * (1/400 mm - 1/8000 mm).
  EXPECT_NEAR(near_x - far_x, 612.4 * 15.01 * (1.0 / 400 - 1.0 / 8000), 2.0);
  EXPECT_NEAR(near_y, far_y, 3);
}

TEST_F(OpenNi2Module, RefusesWhatItHasNot) {
  ASSERT_EQ(depth_.create(device_, openni::SENSOR_DEPTH), openni::STATUS_OK);
  openni::VideoMode mode;
  mode.setResolution(641, kHeight);
  mode.setFps(30);
  mode.setPixelFormat(openni::PIXEL_FORMAT_DEPTH_1_MM);
  EXPECT_NE(depth_.setVideoMode(mode), openni::STATUS_OK);
  EXPECT_NE(depth_.setMirroringEnabled(true), openni::STATUS_OK);
  EXPECT_EQ(depth_.setMirroringEnabled(false), openni::STATUS_OK);
  openni::Device other;
  EXPECT_NE(other.open("d435i/000000000000"), openni::STATUS_OK);
}

}  // namespace
}  // namespace geoflow::drivers::openni2::tests
