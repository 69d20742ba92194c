#include "replay/bag/topic_choice.hpp"

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"

#include "replay/bag/bag.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers {
namespace {

using bag::BagTopic;
using testing::HasSubstr;

BagTopic topic(std::string name, std::string_view type) {
  return {std::move(name), std::string{type}, 1};
}
BagTopic image(std::string name) {
  return topic(std::move(name), ros::Image::kType);
}
BagTopic compressed(std::string name) {
  return topic(std::move(name), ros::CompressedImage::kType);
}

const BagTopic aligned_depth = image("/camera/aligned_depth_to_color/image_raw");

TEST(TopicChoice, NamesOfThePapersBagsAreTheDefault) {
  const auto choice = bag::choose_topics(
      {image("/camera/color/image_raw"), aligned_depth,
       topic("/camera/color/camera_info", ros::CameraInfo::kType),
       topic("/camera/imu", ros::Imu::kType), topic("/dog_imu", ros::Imu::kType),
       topic("/joint_foot", ros::JointState::kType), topic("/robot_odom", ros::Odometry::kType)},
      {});
  ASSERT_TRUE(choice) << choice.error().message;
  EXPECT_EQ(choice->color, "/camera/color/image_raw");
  EXPECT_EQ(choice->depth, "/camera/aligned_depth_to_color/image_raw");
  EXPECT_EQ(choice->camera_info, "/camera/color/camera_info");
  EXPECT_EQ(choice->imu, "/camera/imu");
  EXPECT_EQ(choice->legs, "/joint_foot");
  EXPECT_EQ(choice->odometry, "/robot_odom");
}

TEST(TopicChoice, NamespaceOfRealsenseRosIsFound) {
  const auto choice =
      bag::choose_topics({image("/camera/camera/color/image_raw"),
                          image("/camera/camera/aligned_depth_to_color/image_raw"),
                          topic("/camera/camera/color/camera_info", ros::CameraInfo::kType),
                          topic("/camera/camera/imu", ros::Imu::kType)},
                         {});
  ASSERT_TRUE(choice) << choice.error().message;
  EXPECT_EQ(choice->color, "/camera/camera/color/image_raw");
  EXPECT_EQ(choice->depth, "/camera/camera/aligned_depth_to_color/image_raw");
  EXPECT_EQ(choice->camera_info, "/camera/camera/color/camera_info");
  EXPECT_EQ(choice->imu, "/camera/camera/imu");
  EXPECT_EQ(choice->legs, "");
}

TEST(TopicChoice, OtherCamerasAndCompressedTransportsAreFound) {
  const auto choice =
      bag::choose_topics({compressed("/d435i/color/image_raw/compressed"),
                          compressed("/d435i/aligned_depth_to_color/image_raw/compressedDepth"),
                          topic("/d435i/color/camera_info", ros::CameraInfo::kType)},
                         {});
  ASSERT_TRUE(choice) << choice.error().message;
  EXPECT_EQ(choice->color, "/d435i/color/image_raw/compressed");
  EXPECT_EQ(choice->depth, "/d435i/aligned_depth_to_color/image_raw/compressedDepth");
  EXPECT_EQ(choice->camera_info, "/d435i/color/camera_info");
}

TEST(TopicChoice, SeveralCandidatesAreAnErrorThatNamesThem) {
  const auto choice = bag::choose_topics(
      {image("/left/color/image_raw"), image("/right/color/image_raw"), aligned_depth}, {});
  ASSERT_FALSE(choice);
  EXPECT_THAT(choice.error().message, HasSubstr("/left/color/image_raw"));
  EXPECT_THAT(choice.error().message, HasSubstr("/right/color/image_raw"));
}

TEST(TopicChoice, NameWithAnotherTypeIsAnError) {
  const auto choice = bag::choose_topics({image("/camera/color/image_raw"), aligned_depth,
                                          topic("/camera/imu", "std_msgs/msg/String")},
                                         {});
  ASSERT_FALSE(choice);
  EXPECT_EQ(choice.error().message,
            "topic /camera/imu is of type std_msgs/msg/String, but the camera's IMU must be "
            "sensor_msgs/msg/Imu");
}

TEST(TopicChoice, BagWithoutDepthIsAnErrorThatListsTheTopics) {
  const auto choice = bag::choose_topics({image("/camera/color/image_raw")}, {});
  ASSERT_FALSE(choice);
  EXPECT_THAT(choice.error().message, HasSubstr("no depth topic"));
  EXPECT_THAT(choice.error().message,
              HasSubstr("/camera/color/image_raw (sensor_msgs/msg/Image, 1 messages)"));
}

TEST(TopicChoice, BagMayHaveLegsAlone) {
  const auto choice = bag::choose_topics({topic("/joint_foot", ros::JointState::kType)}, {});
  ASSERT_TRUE(choice) << choice.error().message;
  EXPECT_EQ(choice->legs, "/joint_foot");
  EXPECT_EQ(choice->color, "");
  EXPECT_EQ(choice->camera_info, "");
}

TEST(TopicChoice, EmptyNameIsNotWanted) {
  TopicNames names;
  names.imu = "";
  const auto choice = bag::choose_topics(
      {image("/camera/color/image_raw"), aligned_depth, topic("/camera/imu", ros::Imu::kType)},
      names);
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->imu, "");
}

}  // namespace
}  // namespace geoflow::drivers
