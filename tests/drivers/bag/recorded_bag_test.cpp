#include <cstdint>
#include <string_view>

#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

#include "replay/bag/bag.hpp"
#include "replay/bag/reader.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"

/// Bags that other software recorded.
namespace geoflow::drivers {
namespace {

TEST(RecordedBag, TransformsOfARealBagAreListedAndRead) {
  GEOFLOW_DATA_OR_SKIP(data, "rosbag2");
  const auto opened = bag::Bag::open(data / "tf_example");
  ASSERT_TRUE(opened) << opened.error().message;
  bag::Bag& bag = **opened;
  ASSERT_TRUE(bag.find("/tf"));
  EXPECT_EQ(bag.find("/tf")->type, "tf2_msgs/msg/TFMessage");
  EXPECT_EQ(bag.find("/tf")->count, 517U);
  EXPECT_EQ(bag.end_ns() - bag.start_ns(), 51'684'723'334);
  bag.select([](std::string_view) { return true; });
  int count = 0;
  std::int64_t last_ns = 0;
  for (auto message = bag.next(); message && *message; message = bag.next()) {
    const auto tf = cdr::decode<ros::TfMessage>((*message)->data);
    ASSERT_TRUE(tf) << tf.error().message;
    EXPECT_GT(tf->transforms.size(), 0U);
    EXPECT_GE((*message)->timestamp_ns, last_ns);
    last_ns = (*message)->timestamp_ns;
    ++count;
  }
  EXPECT_EQ(count, 518);
  EXPECT_TRUE(bag.complete());
}

TEST(RecordedBag, BagWithoutCameraIsRefusedWithAListOfItsTopics) {
  GEOFLOW_DATA_OR_SKIP(data, "rosbag2");
  for (const auto& path : {data / "tf_example", data / "tf_example" / "tf_example.db3"}) {
    EXPECT_TRUE(bag::looks_like(path));
    const auto reader = bag::open(path, {});
    ASSERT_FALSE(reader);
    EXPECT_EQ(reader.error().code, ErrorCode::kNotFound);
    EXPECT_EQ(reader.error().message,
              path.native() +
                  ": no camera topics: looked for /camera/color/image_raw and "
                  "/camera/aligned_depth_to_color/image_raw; the bag has: /tf_static "
                  "(tf2_msgs/msg/TFMessage, 1 messages), "
                  "/tf (tf2_msgs/msg/TFMessage, 517 messages)");
  }
}

}  // namespace
}  // namespace geoflow::drivers
