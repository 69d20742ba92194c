#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <zlib.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"
#include "replay/scannet/geometry.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::drain;
using tests::message_of;
using tests::Recorder;

constexpr int kColorWidth = 64;
constexpr int kColorHeight = 48;
constexpr int kDepthWidth = 32;
constexpr int kDepthHeight = 24;

template <typename Value>
void put(std::string& bytes, const Value& value) {
  bytes.append(sizeof value, '\0');
  std::memcpy(bytes.data() + bytes.size() - sizeof value, &value, sizeof value);
}

void put(std::string& bytes, const Eigen::Matrix4d& matrix) {
  for (int i = 0; i < matrix.size(); ++i) {
    put(bytes, static_cast<float>(matrix(i / 4, i % 4)));
  }
}

Eigen::Matrix4d intrinsic(double f, double cx, double cy) {
  Eigen::Matrix4d K = Eigen::Matrix4d::Identity();
  K(0, 0) = K(1, 1) = f;
  K(0, 2) = cx;
  K(1, 2) = cy;
  return K;
}

struct Scan {
  Eigen::Matrix4d depth_extrinsic = Eigen::Matrix4d::Identity();
  std::int32_t color_coding = 2;
  std::int32_t depth_coding = 1;
  std::uint64_t declared = 3;
  int frames = 3;
  std::uint64_t first_stamp_us = 0;  ///< 0: no stamps
  int lost_frame = 1;                ///< whose pose is infinite

  [[nodiscard]] std::string header() const {
    std::string bytes;
    put(bytes, std::uint32_t{4});
    put(bytes, std::uint64_t{6});
    bytes += "Sensor";
    put(bytes, intrinsic(60, 31.5, 23.5));
    put(bytes, Eigen::Matrix4d::Identity().eval());
    put(bytes, intrinsic(30, 15.5, 11.5));
    put(bytes, depth_extrinsic);
    put(bytes, color_coding);
    put(bytes, depth_coding);
    for (const int side : {kColorWidth, kColorHeight, kDepthWidth, kDepthHeight}) {
      put(bytes, static_cast<std::uint32_t>(side));
    }
    put(bytes, 1000.0F);
    put(bytes, declared);
    return bytes;
  }

  [[nodiscard]] Eigen::Matrix4d pose(int i) const {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 3) = i;
    return i == lost_frame
               ? Eigen::Matrix4d::Constant(-std::numeric_limits<double>::infinity()).eval()
               : pose;
  }

  [[nodiscard]] std::string frame(int i) const {
    std::vector<unsigned char> color;
    cv::imencode(color_coding == 2 ? ".jpg" : ".png",
                 cv::Mat{kColorHeight, kColorWidth, CV_8UC3, cv::Scalar(10 + i, 100, 200)}, color);
    const std::vector<std::uint16_t> depth(std::size_t{kDepthWidth} * kDepthHeight,
                                           static_cast<std::uint16_t>(1500 + i));
    std::vector<unsigned char> packed(compressBound(depth.size() * 2));
    unsigned long length = packed.size();
    EXPECT_EQ(compress(packed.data(), &length, reinterpret_cast<const unsigned char*>(depth.data()),
                       depth.size() * 2),
              Z_OK);
    std::string bytes;
    put(bytes, pose(i));
    const auto index = static_cast<std::uint64_t>(i);
    put(bytes, first_stamp_us == 0 ? 0 : first_stamp_us + 40'000 * index);
    put(bytes, first_stamp_us == 0 ? 0 : first_stamp_us + 1'000 + 40'000 * index);
    put(bytes, std::uint64_t{color.size()});
    put(bytes, std::uint64_t{length});
    bytes.append(color.begin(), color.end());
    bytes.append(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(length));
    return bytes;
  }

  [[nodiscard]] std::string bytes() const {
    std::string all = header();
    for (int i = 0; i < frames; ++i) {
      all += frame(i);
    }
    put(all, std::uint64_t{0});  // no inertial samples
    return all;
  }
};

std::filesystem::path written(const TemporaryDirectory& directory, const std::string& bytes) {
  const auto path = directory.path() / "scene0000_00.sens";
  tests::write_text(path, bytes);
  return path;
}

TEST(ScanNet, GivesColourAndDepthInOneView) {
  const TemporaryDirectory directory;
  const auto path = written(directory, Scan{}.bytes());
  for (const auto& place : {path, directory.path()}) {
    auto streams = RecordedStreams::open({.path = place});
    ASSERT_TRUE(streams) << streams.error().message;
    EXPECT_EQ((*streams)->info().format, "scannet");
    Recorder recorder;
    ASSERT_TRUE((*streams)->camera().start(recorder));
    EXPECT_THAT(drain(**streams), IsEmpty());
    EXPECT_EQ(recorder.order, "cdcdcd");
    ASSERT_EQ(recorder.colors.size(), 3U);
    ASSERT_EQ(recorder.depths.size(), 3U);
    const FrameRef& color = recorder.colors[2].sample.image;
    EXPECT_EQ(color.shape(), (ImageShape{kDepthWidth, kDepthHeight, PixelFormat::kBgr8}));
    EXPECT_NEAR(color.row<std::uint8_t>(7)[0], 12, 3);  // JPEG
    EXPECT_NEAR(color.row<std::uint8_t>(7)[2], 200, 3);
    EXPECT_EQ(recorder.depths[2].sample.image.row<std::uint16_t>(5)[3], 1502);
    const Calibration& calibration = (*streams)->calibration();
    EXPECT_EQ(calibration.camera.width, kDepthWidth);
    EXPECT_EQ(calibration.camera.fx, 30);
    EXPECT_DOUBLE_EQ(calibration.depth_unit_m, 1e-3);
    EXPECT_THAT(calibration.source, HasSubstr("Sensor"));
  }
}

TEST(ScanNet, WithoutStampsFramesFollowAt30HzAndLostPosesAreSkipped) {
  const TemporaryDirectory directory;
  const auto streams = RecordedStreams::open({.path = written(directory, Scan{}.bytes())});
  ASSERT_TRUE(streams) << streams.error().message;
  const Trajectory& poses = (*streams)->reference();
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[0].t, HostTime{});
  EXPECT_EQ(poses[1].t, HostTime{from_seconds(2.0 / 30)});
  EXPECT_TRUE(poses[1].pose.translation().isApprox(Vector3d{2, 0, 0}));
}

TEST(ScanNet, IncreasingStampsAreTaken) {
  const TemporaryDirectory directory;
  const Scan scan{.first_stamp_us = 5'000'000};
  auto streams = RecordedStreams::open({.path = written(directory, scan.bytes())});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), IsEmpty());
  EXPECT_EQ((*streams)->info().start, tests::at_ms(5000));
  EXPECT_EQ((*streams)->info().end, tests::at_ms(5081));
  EXPECT_EQ(recorder.colors.at(1).t_device.time_since_epoch(), std::chrono::milliseconds{5040});
  EXPECT_EQ(recorder.depths.at(1).t_device.time_since_epoch(), std::chrono::milliseconds{5041});
  EXPECT_TRUE(std::ranges::is_sorted(recorder.arrivals));
}

TEST(ScanNet, ACutFileGivesWhatItHas) {
  const TemporaryDirectory directory;
  std::string bytes = Scan{}.bytes();
  bytes.resize(bytes.size() - 20);
  auto streams = RecordedStreams::open({.path = written(directory, bytes)});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre(HasSubstr("is cut off: 2 of 3 frames are there")));
  EXPECT_EQ(recorder.order, "cdcd");
  EXPECT_EQ((*streams)->camera().health().state, SourceState::kFailed);
}

TEST(ScanNet, ADamagedImageIsRejectedAlone) {
  const TemporaryDirectory directory;
  const Scan scan;
  std::string bytes = scan.bytes();
  const std::size_t first_depth_end = scan.header().size() + scan.frame(0).size();
  bytes[first_depth_end - 1] ^= 0x55;  // zlib's checksum
  auto streams = RecordedStreams::open({.path = written(directory, bytes)});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre(AllOf(HasSubstr("scene0000_00.sens: frame 0"),
                                                  HasSubstr("damaged depth image"))));
  EXPECT_EQ(recorder.order, "ccdcd");
}

TEST(ScanNet, NamesWhatItCannotRead) {
  const TemporaryDirectory directory;
  const auto message = [&](const std::string& bytes) {
    return message_of(RecordedStreams::open({.path = written(directory, bytes)}));
  };
  EXPECT_THAT(message(Scan{.depth_coding = 2}.bytes()),
              AllOf(HasSubstr("scene0000_00.sens"), HasSubstr("depth coding 2 (occi)")));
  EXPECT_THAT(message(Scan{.color_coding = -1}.bytes()), HasSubstr("colour coding -1"));
  EXPECT_THAT(message(Scan{}.header().substr(0, 200)), HasSubstr("cut off within its header"));
  EXPECT_THAT(message(Scan{}.header()), HasSubstr("has no whole frame"));
  EXPECT_THAT(message(Scan{.depth_extrinsic = Eigen::Matrix4d::Zero()}.bytes()),
              HasSubstr("the depth camera's extrinsic is not a rigid transform"));
  std::string other = Scan{}.bytes();
  other[0] = 3;
  EXPECT_THAT(message(other), HasSubstr(".sens version 3"));
}

/// A file may declare any number of frames: it is not what decides how much is allocated.
TEST(ScanNet, ADeclaredNumberOfFramesIsNotBelieved) {
  const TemporaryDirectory directory;
  const Scan scan{.declared = std::numeric_limits<std::uint64_t>::max()};
  auto streams = RecordedStreams::open({.path = written(directory, scan.bytes())});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->info().streams.at(0).count, 3U);
}

TEST(ScanNet, TheReferenceIsTheColourCameras) {
  const TemporaryDirectory directory;
  Scan scan;
  scan.depth_extrinsic(0, 3) = 0.025;  // depth to colour
  auto streams = RecordedStreams::open({.path = written(directory, scan.bytes())});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_TRUE(
      (*streams)->reference().at(0).pose.translation().isApprox(Vector3d{-0.025, 0, 0}, 1e-6));
}

/// A plane seen by the depth camera, then by a colour camera beside it: every point must be where
/// that camera would see the plane.
TEST(ScanNetGeometry, RegistersATiltedPlane) {
  const CameraIntrinsics depth_camera{
      .width = 160, .height = 120, .fx = 150, .fy = 150, .cx = 79.5, .cy = 59.5};
  CameraIntrinsics color_camera = depth_camera;
  color_camera.fx = color_camera.fy = 155;
  const SE3 T_color_depth{so3::exp({0, 0.01, 0.005}), {0.03, -0.002, 0.004}};
  const Vector3d n_depth = Vector3d{0.3, -0.2, -1}.normalized();
  const double offset_m = -2.0;  // n . p = offset
  const auto ray = [](const CameraIntrinsics& camera, int pixel) {
    const int u = pixel % 160;
    const int v = pixel / 160;
    return Vector3d{(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1};
  };
  std::vector<std::uint16_t> depth;
  depth.reserve(std::size_t{160} * 120);
  for (int i = 0; i < 160 * 120; ++i) {
    depth.push_back(static_cast<std::uint16_t>(
        std::lround(1e3 * offset_m / n_depth.dot(ray(depth_camera, i)))));
  }
  const auto moved = scannet::register_depth(depth, depth_camera, color_camera, T_color_depth, 1e3);
  const Vector3d n_color = T_color_depth.rotation() * n_depth;
  const double offset_color_m = offset_m + n_color.dot(T_color_depth.translation());
  std::size_t seen = 0;
  double worst_mm = 0;
  for (int i = 0; i < 160 * 120; ++i) {
    const std::uint16_t value = moved[static_cast<std::size_t>(i)];
    const double expected_mm = 1e3 * offset_color_m / n_color.dot(ray(color_camera, i));
    if (value != 0) {
      ++seen;
      worst_mm = std::max(worst_mm, std::abs(value - expected_mm));
    }
  }
  // A pixel's depth stands for half a pixel around it: on this plane 0.36 / 150 * 2 m / 2 across.
  EXPECT_LT(worst_mm, 6.0);
  EXPECT_GT(static_cast<double>(seen), 0.93 * 160 * 120);  // what leaves the view is lost
}

TEST(ScanNetGeometry, TheNearerSurfaceHidesTheOther) {
  const CameraIntrinsics camera{
      .width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5};
  std::vector<std::uint16_t> depth(std::size_t{64} * 48, 3000);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (i % 64 < 32) {
      depth[i] = 1000;
    }
  }
  // Moving left by 0.1 m shifts the near half right by 6 px and the far one by 2 px: 4 px overlap.
  const auto moved = scannet::register_depth(depth, camera, camera,
                                             SE3{Eigen::Quaterniond::Identity(), {0.1, 0, 0}}, 1e3);
  for (int x = 0; x < 64; ++x) {
    const std::uint16_t expected = x < 6 ? 0 : x < 38 ? 1000 : 3000;
    EXPECT_EQ(moved[std::size_t{20} * 64 + static_cast<std::size_t>(x)], expected)
        << "column " << x;
  }
}

TEST(ScanNetGeometry, ResamplingKeepsAGradientInPlace) {
  const CameraIntrinsics source{
      .width = 128, .height = 96, .fx = 121, .fy = 119, .cx = 62.7, .cy = 48.9};
  const CameraIntrinsics target{
      .width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5};
  std::vector<std::byte> image;
  for (int i = 0; i < 128 * 96; ++i) {
    image.insert(image.end(),
                 {static_cast<std::byte>(i % 128), static_cast<std::byte>(i / 128), std::byte{77}});
  }
  const auto resampled = scannet::ColorResampler{source, target}(image);
  ASSERT_EQ(resampled.size(), 64U * 48U * 3U);
  for (int y = 2; y < 46; ++y) {
    for (int x = 2; x < 62; ++x) {
      const std::byte* pixel = resampled.data() + std::ptrdiff_t{3} * (y * 64 + x);
      const double u = (x - target.cx) / target.fx * source.fx + source.cx;
      const double v = (y - target.cy) / target.fy * source.fy + source.cy;
      EXPECT_NEAR(std::to_integer<int>(pixel[0]), u, 0.51);
      EXPECT_NEAR(std::to_integer<int>(pixel[1]), v, 0.51);
      EXPECT_EQ(std::to_integer<int>(pixel[2]), 77);
    }
  }
}

}  // namespace
}  // namespace geoflow::drivers
