#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers {
namespace {

using testing::HasSubstr;

TEST(RosNames, NamespacesAreRos2s) {
  for (const char* name : {"", "dog1", "_a", "site_2/dog1"}) {
    EXPECT_TRUE(RosPublisher::check({.name = name})) << name;
  }
  for (const char* name : {"/dog1", "dog1/", "a//b", "1dog", "site/2", "dog-1", "dög", " "}) {
    const auto checked = RosPublisher::check({.name = name});
    ASSERT_FALSE(checked) << name;
    EXPECT_EQ(checked.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(checked.error().message, HasSubstr("ros.name: '"));
  }
}

TEST(RosNames, FramesAreThreeNamesThatTf2Takes) {
  EXPECT_TRUE(RosPublisher::check({.base_frame = "dog1/base_link"}));
  EXPECT_THAT(RosPublisher::check({.map_frame = ""}).error().message, HasSubstr("ros.map_frame"));
  EXPECT_THAT(RosPublisher::check({.odom_frame = "/odom"}).error().message,
              HasSubstr("ros.odom_frame: '/odom'"));
  EXPECT_THAT(RosPublisher::check({.base_frame = "base link"}).error().message,
              HasSubstr("ros.base_frame"));
  EXPECT_THAT(RosPublisher::check({.base_frame = "odom"}).error().message,
              HasSubstr("name of another frame"));
}

}  // namespace
}  // namespace geoflow::drivers
