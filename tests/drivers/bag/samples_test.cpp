#include "replay/bag/samples.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/bag/transforms.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using testing::HasSubstr;

/// The message of a failure; empty where there is none.
template <typename T>
std::string error_of(const Result<T>& result) {
  return result ? std::string{} : result.error().message;
}

ros::JointState joints(const std::vector<std::string>& names, std::size_t count) {
  ros::JointState message;
  message.name = names;
  for (std::size_t i = 0; i < count; ++i) {
    message.position.push_back(static_cast<double>(i));
    message.velocity.push_back(100.0 + static_cast<double>(i));
    message.effort.push_back(200.0 + static_cast<double>(i));
  }
  return message;
}

TEST(LegSamples, JointsAreTakenByNameWhateverTheirOrder) {
  // The order of Cerberus' and its descendants' joint_foot messages.
  const auto sample =
      bag::to_sample(joints({"FL0", "FL1", "FL2", "FR0", "FR1", "FR2", "RL0", "RL1", "RL2", "RR0",
                             "RR1", "RR2", "FL_foot", "FR_foot", "RL_foot", "RR_foot"},
                            16));
  ASSERT_TRUE(sample) << sample.error().message;
  const auto hip = [&](Leg leg) {
    return sample->joints[static_cast<std::size_t>(leg) * kJointsPerLeg];
  };
  EXPECT_EQ(hip(Leg::kFrontLeft).q_rad, 0);
  EXPECT_EQ(hip(Leg::kFrontRight).q_rad, 3);
  EXPECT_EQ(hip(Leg::kRearLeft).dq_radps, 106);
  EXPECT_EQ(hip(Leg::kRearRight).tau_nm, 209);
  EXPECT_EQ(sample->foot_force, (std::array{213.0F, 212.0F, 215.0F, 214.0F}));
  EXPECT_EQ(sample->valid, (std::array{true, true, true, true}));
}

TEST(LegSamples, UrdfNamesAndMissingLegsAreUnderstood) {
  const auto sample = bag::to_sample(
      joints({"RL_calf_joint", "RL_hip_joint", "RL_thigh_joint", "FR_hip_joint"}, 4));
  ASSERT_TRUE(sample) << sample.error().message;
  EXPECT_EQ(sample->joints[11].q_rad, 0);
  EXPECT_EQ(sample->joints[9].q_rad, 1);
  EXPECT_EQ(sample->joints[10].q_rad, 2);
  EXPECT_EQ(sample->valid, (std::array{false, false, false, true}));
}

TEST(LegSamples, JointsWithoutKnownNamesAreInSdkOrder) {
  for (const std::size_t count : {12U, 16U}) {
    const auto sample = bag::to_sample(joints({}, count));
    ASSERT_TRUE(sample) << sample.error().message;
    EXPECT_EQ(sample->joints[11].q_rad, 11);
    EXPECT_EQ(sample->foot_force[3], count == 16 ? 215.0F : 0.0F);
    EXPECT_EQ(sample->valid, (std::array{true, true, true, true}));
  }
}

TEST(LegSamples, WhatFitsNoRobotIsRefused) {
  EXPECT_THAT(error_of(bag::to_sample(joints({"FL0", "arm"}, 2))),
              HasSubstr("joint 'arm' is of no leg"));
  EXPECT_THAT(error_of(bag::to_sample(joints({"FL0", "FL_hip_joint"}, 2))),
              HasSubstr("is there twice"));
  EXPECT_THAT(error_of(bag::to_sample(joints({}, 7))), HasSubstr("7 joints without known names"));
  EXPECT_THAT(error_of(bag::to_sample(joints({"FL0", "FL1"}, 1))),
              HasSubstr("2 joints with 1 positions"));
}

ros::Image image(std::uint32_t side, std::string encoding, std::uint32_t step, ros::Bytes data) {
  ros::Image message;
  message.height = side;
  message.width = side;
  message.encoding = std::move(encoding);
  message.step = step;
  message.data = data;
  return message;
}

ros::CompressedImage compressed(std::string format, ros::Bytes data) {
  ros::CompressedImage message;
  message.format = std::move(format);
  message.data = data;
  return message;
}

TEST(ImageSamples, DepthInMetresAndRowsWithPaddingKeepTheirLayout) {
  const std::vector<std::byte> data(std::size_t{3} * 20);
  auto message = image(3, "32FC1", 20, data);
  auto read = bag::to_image(message, ImageStream::kDepth);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->raw.metres_f32);
  EXPECT_EQ(read->raw.step_bytes, 20U);
  EXPECT_EQ(read->bytes.size(), 60U);
  message.data = message.data.first(51);
  EXPECT_THAT(error_of(bag::to_image(message, ImageStream::kDepth)), HasSubstr("has 51 bytes"));
  message.step = 11;
  EXPECT_FALSE(bag::to_image(message, ImageStream::kDepth));
}

TEST(ImageSamples, EncodingsOfTheOtherStreamAndUnknownOnesAreNamed) {
  auto message = image(1, "rgb8", 3, {});
  EXPECT_THAT(error_of(bag::to_image(message, ImageStream::kDepth)),
              HasSubstr("a depth image with encoding 'rgb8'"));
  message.encoding = "bayer_rggb8";
  EXPECT_THAT(error_of(bag::to_image(message, ImageStream::kColor)), HasSubstr("'bayer_rggb8'"));
}

TEST(ImageSamples, HugeSizesAreRefused) {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  auto message = image(kMost, "mono8", kMost, {});
  EXPECT_FALSE(bag::to_image(message, ImageStream::kColor));
  message.height = 2;
  EXPECT_FALSE(bag::to_image(message, ImageStream::kColor));
}

TEST(ImageSamples, CompressedDepthLosesItsParameters) {
  std::vector<std::byte> data(20);
  data[12] = std::byte{0x89};
  auto message = compressed("16UC1; compressedDepth png", data);
  const auto read = bag::to_image(message, ImageStream::kDepth);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->encoding, ImageEncoding::kCompressed);
  ASSERT_EQ(read->bytes.size(), 8U);
  EXPECT_EQ(read->bytes.front(), std::byte{0x89});
  message.format = "16UC1; compressedDepth rvl";
  EXPECT_FALSE(bag::to_image(message, ImageStream::kDepth));
  message.format = "32FC1; compressedDepth png";
  EXPECT_FALSE(bag::to_image(message, ImageStream::kDepth));
  message = compressed("16UC1; compressedDepth", std::span{data}.first(12));
  EXPECT_FALSE(bag::to_image(message, ImageStream::kDepth));
}

TEST(CameraInfo, UncalibratedAndForeignModelsAreRefused) {
  CameraIntrinsics camera{.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240};
  EXPECT_EQ(bag::to_intrinsics(bag::to_message(camera))->model, DistortionModel::kNone);
  camera.model = DistortionModel::kEquidistant;
  camera.distortion = {0.1, 0.2, 0.3, 0.4, 0};
  const auto fisheye = bag::to_intrinsics(bag::to_message(camera));
  ASSERT_TRUE(fisheye);
  EXPECT_EQ(fisheye->model, DistortionModel::kEquidistant);
  EXPECT_EQ(fisheye->distortion, camera.distortion);
  auto rational = bag::to_message(camera);
  rational.distortion_model = "rational_polynomial";
  rational.d = {0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0};
  EXPECT_EQ(bag::to_intrinsics(rational)->model, DistortionModel::kRadtan);
  rational.d.back() = 0.1;
  EXPECT_FALSE(bag::to_intrinsics(rational));
  ros::CameraInfo uncalibrated;
  uncalibrated.width = uncalibrated.height = 100;
  EXPECT_THAT(error_of(bag::to_intrinsics(uncalibrated)), HasSubstr("no focal length"));
}

TEST(Stamps, RangeOfARosStampIsRespected) {
  EXPECT_EQ(bag::to_stamp(Duration{-1})->sec, -1);
  EXPECT_EQ(bag::to_stamp(Duration{-1})->nanosec, 999'999'999U);
  EXPECT_EQ(*bag::to_duration(*bag::to_stamp(Duration{-1})), Duration{-1});
  EXPECT_FALSE(bag::to_stamp(Duration::max()));
  EXPECT_FALSE(bag::to_stamp(Duration::min()));
  EXPECT_FALSE(bag::to_duration({.sec = 0, .nanosec = 1'000'000'000}));
}

ros::TransformStamped transform(std::string parent, std::string child, const SE3& T_parent_child) {
  return {.header = {.stamp = {}, .frame_id = std::move(parent)},
          .child_frame_id = std::move(child),
          .transform = bag::to_transform(T_parent_child)};
}

TEST(StaticTransforms, FramesAreConnectedOverOthersInBothDirections) {
  const SE3 T_base_camera = SE3::exp((Vector6d{} << 0.1, 0.2, 0.3, 1, 2, 3).finished());
  const SE3 T_camera_imu = SE3::exp((Vector6d{} << -0.4, 0.1, 0, 0.5, 0, 0).finished());
  bag::StaticTransforms transforms;
  transforms.add(transform("base_link", "camera_link", T_base_camera));
  transforms.add(transform("/camera_link", "imu", T_camera_imu));
  transforms.add(transform("elsewhere", "nowhere", SE3{}));
  const auto T_imu_base = transforms.find("imu", "base_link");
  ASSERT_TRUE(T_imu_base);
  const SE3 round = *T_imu_base * T_base_camera * T_camera_imu;
  constexpr double kRounding = 1e-14;
  EXPECT_LT(round.log().norm(), kRounding);
  EXPECT_FALSE(transforms.find("base_link", "nowhere"));
  EXPECT_FALSE(transforms.find("base_link", "unheard"));
}

TEST(StaticTransforms, WhatIsNoRotationIsPassedOver) {
  auto broken = transform("a", "b", SE3{});
  broken.transform.rotation.w = 0;
  bag::StaticTransforms transforms;
  transforms.add(broken);
  EXPECT_FALSE(transforms.find("a", "b"));
  broken.transform.rotation.w = std::numeric_limits<double>::quiet_NaN();
  transforms.add(broken);
  EXPECT_FALSE(transforms.find("a", "b"));
}

}  // namespace
}  // namespace geoflow::drivers
