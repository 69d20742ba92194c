#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/bag/bag.hpp"
#include "replay/bag/reader.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using ColorArrival = Arrival<CameraClock, ColorFrame>;
using DepthArrival = Arrival<CameraClock, DepthFrame>;
using ImuArrival = Arrival<ImuClock, ImuSample>;
using LegArrival = Arrival<LegClock, LegSample>;
using VelocityArrival = Arrival<LegClock, BodyVelocitySample>;
using Written = std::variant<ColorArrival, DepthArrival, ImuArrival, LegArrival, VelocityArrival>;

Calibration calibration() {
  Calibration calibration;
  calibration.camera = {.width = 6,
                        .height = 4,
                        .fx = 517.25,
                        .fy = 516.5,
                        .cx = 3.1,
                        .cy = 1.9,
                        .model = DistortionModel::kRadtan,
                        .distortion = {0.1, -0.2, 1e-3, -2e-3, 0.05}};
  calibration.depth_unit_m = 1.0 / 5000.0;
  calibration.T_cam_imu = SE3::exp((Vector6d{} << 0.01, -0.02, 0.03, 0.1, 0.2, -0.3).finished());
  calibration.T_base_cam = SE3::exp((Vector6d{} << -1.2, 1.1, -1.0, 0.33, 0.01, 0.05).finished());
  calibration.timeshift_cam_imu = Duration{-1'234'567};
  calibration.imu_noise.accel_noise_density = 0.0123;
  return calibration;
}

double any_double() {
  return std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>());
}
Vector3d any_vector() {
  return {any_double(), any_double(), any_double()};
}

FrameRef any_frame(FramePool& pool, PixelFormat format) {
  FrameRef frame = pool.acquire({.width = 6, .height = 4, .format = format});
  for (std::byte& byte : frame.writable_bytes()) {
    byte = std::byte{*rc::gen::arbitrary<std::uint8_t>()};
  }
  return frame;
}

LegSample any_legs() {
  LegSample sample;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    sample.valid[leg] = *rc::gen::arbitrary<bool>();
    sample.foot_force[leg] = static_cast<float>(*rc::gen::inRange(-1000, 1000)) / 7.0F;
    for (std::size_t joint = 0; sample.valid[leg] && joint < kJointsPerLeg; ++joint) {
      sample.joints[leg * kJointsPerLeg + joint] = {any_double(), any_double(), any_double()};
    }
  }
  return sample;
}

class RandomSamples {
 public:
  Written make(HostTime arrival) {
    const Duration stamp = arrival.time_since_epoch() - Duration{*rc::gen::inRange(1, 1'000'000)};
    const DeviceTime<CameraClock> camera{stamp};
    constexpr std::array kColors{PixelFormat::kRgb8, PixelFormat::kBgr8, PixelFormat::kGray8,
                                 PixelFormat::kYuyv};
    switch (*rc::gen::inRange(0, 5)) {
      case 0:
        return ColorArrival{camera, arrival, {any_frame(pool_, *rc::gen::elementOf(kColors))}};
      case 1:
        return DepthArrival{camera, arrival, {any_frame(pool_, PixelFormat::kDepth16)}};
      case 2:
        return ImuArrival{DeviceTime<ImuClock>{stamp}, arrival, {any_vector(), any_vector()}};
      case 3:
        return LegArrival{DeviceTime<LegClock>{stamp}, arrival, any_legs()};
      default:
        return VelocityArrival{DeviceTime<LegClock>{stamp}, arrival, {any_vector(), any_vector()}};
    }
  }

 private:
  FramePool pool_{64};
};

void write(BagWriter& writer, const Written& written) {
  std::visit(
      [&writer](const auto& sample) {
        using T = std::decay_t<decltype(sample)>;
        if constexpr (std::is_same_v<T, ColorArrival>) {
          writer.on_color(sample);
        } else if constexpr (std::is_same_v<T, DepthArrival>) {
          writer.on_depth(sample);
        } else if constexpr (std::is_same_v<T, ImuArrival>) {
          writer.on_imu(sample);
        } else if constexpr (std::is_same_v<T, LegArrival>) {
          writer.on_legs(sample);
        } else {
          writer.on_body_velocity(sample);
        }
      },
      written);
}

// The bits are what must come back: also a NaN's, and the sign of zero.
// NOLINTBEGIN(bugprone-suspicious-memory-comparison)
bool same_bits(const auto& a, const auto& b) {
  static_assert(sizeof(a) == sizeof(b));
  return std::memcmp(&a, &b, sizeof(a)) == 0;
}

bool same(const Vector3d& a, const Vector3d& b) {
  return std::memcmp(a.data(), b.data(), 3 * sizeof(double)) == 0;
}
// NOLINTEND(bugprone-suspicious-memory-comparison)

bool same(const FrameRef& frame, const EncodedImage& image, ImageStream stream) {
  return image.stream == stream && image.encoding == ImageEncoding::kRaw &&
         image.raw.shape == frame.shape() && image.raw.step_bytes == frame.shape().row_bytes() &&
         std::ranges::equal(image.bytes, frame.bytes());
}
bool same(const ColorFrame& a, const EncodedImage& b) {
  return same(a.image, b, ImageStream::kColor);
}
bool same(const DepthFrame& a, const EncodedImage& b) {
  return same(a.image, b, ImageStream::kDepth);
}
bool same(const ImuSample& a, const ImuSample& b) {
  return same(a.accel_mps2, b.accel_mps2) && same(a.gyro_radps, b.gyro_radps);
}
bool same(const LegSample& a, const LegSample& b) {
  return same_bits(a.joints, b.joints) && a.foot_force == b.foot_force && a.valid == b.valid;
}
bool same(const BodyVelocitySample& a, const BodyVelocitySample& b) {
  return same(a.v_base_mps, b.v_base_mps) && same(a.w_base_radps, b.w_base_radps);
}

bool same(const Written& written, const Event& event) {
  return std::visit(
      [](const auto& a, const auto& b) {
        if constexpr (requires {
                        same(a.sample, b.sample);
                        a.t_device == b.t_device;
                      }) {
          return a.t_device == b.t_device && a.t_arrival == b.t_arrival && same(a.sample, b.sample);
        } else {
          return false;
        }
      },
      written, event);
}

std::unique_ptr<RecordingReader> open_bag(const std::filesystem::path& path) {
  auto reader = bag::open(path, {});
  EXPECT_TRUE(reader) << reader.error().message;
  return reader ? std::move(*reader) : nullptr;
}

TEST(BagRoundTrip, EverySampleComesBackBitForBitInOrderOfArrival) {
  EXPECT_TRUE(rc::check([] {
    const tests::TemporaryDirectory folder;
    const auto path = folder.path() / "bag";
    RandomSamples random;
    HostTime arrival{std::chrono::seconds{*rc::gen::inRange(1, 2'000'000'000)}};
    // The two images make it a recording of a camera whatever else is in it.
    std::vector<Written> written;
    FramePool pool{2};
    written.emplace_back(ColorArrival{
        DeviceTime<CameraClock>{Duration{1}}, arrival, {any_frame(pool, PixelFormat::kRgb8)}});
    written.emplace_back(DepthArrival{
        DeviceTime<CameraClock>{Duration{1}}, arrival, {any_frame(pool, PixelFormat::kDepth16)}});
    const int count = *rc::gen::inRange(0, 40);
    for (int i = 0; i < count; ++i) {
      arrival += Duration{*rc::gen::inRange(0, 100'000'000)};
      written.push_back(random.make(arrival));
    }
    BagWriterOptions options{.directory = path};
    options.compress = *rc::gen::arbitrary<bool>();
    options.storage = *rc::gen::element(BagStorage::kSqlite, BagStorage::kMcap);
    auto writer = BagWriter::create(options, calibration());
    RC_ASSERT(writer.has_value());
    for (const Written& sample : written) {
      write(**writer, sample);
    }
    RC_ASSERT((*writer)->close().has_value());

    const auto reader = bag::open(path, {});
    RC_ASSERT(reader.has_value());
    for (const Written& sample : written) {
      const auto event = (*reader)->next();
      RC_ASSERT(event.has_value());
      RC_ASSERT(event->has_value());
      RC_ASSERT(same(sample, **event));
    }
    RC_ASSERT_FALSE((*reader)->next()->has_value());
    RC_ASSERT((*reader)->complete());
  }));
}

class CalibrationRoundTrip : public testing::TestWithParam<BagStorage> {};
INSTANTIATE_TEST_SUITE_P(Storages, CalibrationRoundTrip,
                         testing::Values(BagStorage::kSqlite, BagStorage::kMcap));

TEST_P(CalibrationRoundTrip, CalibrationComesBack) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag";
  FramePool pool{2};
  BagWriterOptions options{.directory = path, .storage = GetParam()};
  options.imu_stamps = {.domain = StampDomain::kDevice,
                        .wrap = std::chrono::microseconds{1LL << 32},
                        .on_camera_clock = true};
  auto writer = BagWriter::create(options, calibration());
  ASSERT_TRUE(writer) << writer.error().message;
  const HostTime t{std::chrono::seconds{100}};
  const DeviceTime<CameraClock> stamp{std::chrono::seconds{100}};
  (*writer)->on_color(
      {stamp, t, {pool.acquire({.width = 6, .height = 4, .format = PixelFormat::kBgr8})}});
  (*writer)->on_depth(
      {stamp, t, {pool.acquire({.width = 6, .height = 4, .format = PixelFormat::kDepth16})}});
  (*writer)->on_imu({DeviceTime<ImuClock>{std::chrono::seconds{7}}, t, {}});
  ASSERT_TRUE((*writer)->close());

  const auto reader = open_bag(path);
  ASSERT_TRUE(reader);
  const FoundCalibration found = reader->calibration();
  const Calibration expected = calibration();
  ASSERT_TRUE(found.camera);
  EXPECT_EQ(found.camera->width, 6);
  EXPECT_EQ(found.camera->fx, expected.camera.fx);
  EXPECT_EQ(found.camera->cy, expected.camera.cy);
  EXPECT_EQ(found.camera->model, DistortionModel::kRadtan);
  EXPECT_EQ(found.camera->distortion, expected.camera.distortion);
  EXPECT_EQ(found.depth_unit_m, expected.depth_unit_m);
  constexpr double kRounding = 1e-15;
  ASSERT_TRUE(found.T_base_cam);
  EXPECT_LT((found.T_base_cam->matrix() - expected.T_base_cam->matrix()).norm(), kRounding);
  ASSERT_TRUE(found.T_cam_imu);
  EXPECT_LT((found.T_cam_imu->matrix() - expected.T_cam_imu->matrix()).norm(), kRounding);
  EXPECT_EQ(found.timeshift_cam_imu, expected.timeshift_cam_imu);
  ASSERT_TRUE(found.imu_noise);
  EXPECT_EQ(found.imu_noise->accel_noise_density, 0.0123);
  EXPECT_TRUE(reader->info().has(StreamId::kColor));
  EXPECT_TRUE(reader->info().has(StreamId::kDepth));
  EXPECT_TRUE(reader->info().has(StreamId::kImu));
  EXPECT_FALSE(reader->info().has(StreamId::kLegs));
  EXPECT_EQ(reader->stamps().camera.domain, StampDomain::kHost);
  EXPECT_EQ(reader->stamps().imu.domain, StampDomain::kDevice);
  EXPECT_EQ(reader->stamps().imu.wrap, Duration{4'294'967'296'000});
  EXPECT_TRUE(reader->stamps().imu.on_camera_clock);
}

TEST(BagRoundTrip, ClosedBagIsOneDatabaseAndItsDescription) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "walk";
  auto writer = BagWriter::create({.directory = path}, calibration());
  ASSERT_TRUE(writer);
  (*writer)->on_imu({DeviceTime<ImuClock>{Duration{5}}, HostTime{Duration{9}}, {}});
  ASSERT_TRUE((*writer)->close());
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator{path}) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("metadata.yaml", "walk_0.db3"));
}

TEST(BagRoundTrip, FolderThatExistsIsRefused) {
  const tests::TemporaryDirectory folder;
  const auto writer = BagWriter::create({.directory = folder.path()}, calibration());
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(writer.error().message.find(folder.path().native()), std::string::npos);
}

TEST(BagRoundTrip, PosesAreWrittenAsOdometry) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag";
  const SE3 T_odom_base = SE3::exp((Vector6d{} << 0.1, 0.2, 0.3, 1, 2, 3).finished());
  auto writer = BagWriter::create({.directory = path}, calibration());
  ASSERT_TRUE(writer);
  (*writer)->write_odometry("/ground_truth", HostTime{Duration{1'500'000'000}},
                            {.T_parent_child = T_odom_base, .v_child_mps = {1, 0, 0}});
  ASSERT_TRUE((*writer)->close());
  auto bag = bag::Bag::open(path);
  ASSERT_TRUE(bag) << bag.error().message;
  (*bag)->select([](std::string_view topic) { return topic == "/ground_truth"; });
  const auto message = (*bag)->next();
  ASSERT_TRUE(message && *message);
  const auto odometry = cdr::decode<ros::Odometry>((*message)->data);
  ASSERT_TRUE(odometry) << odometry.error().message;
  EXPECT_EQ(odometry->header.frame_id, "odom");
  EXPECT_EQ(odometry->child_frame_id, "base_link");
  EXPECT_EQ(odometry->header.stamp.sec, 1);
  EXPECT_EQ(odometry->header.stamp.nanosec, 500'000'000U);
  EXPECT_EQ(odometry->pose.pose.position.y, T_odom_base.translation().y());
  EXPECT_EQ(odometry->pose.pose.orientation.w, T_odom_base.rotation().w());
  EXPECT_EQ(odometry->twist.twist.linear.x, 1.0);
}

}  // namespace
}  // namespace geoflow::drivers
