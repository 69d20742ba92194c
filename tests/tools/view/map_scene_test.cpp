#include "view/map_scene.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

/// A small map, of the fuzz target's seeds.
const std::filesystem::path kMap = GEOFLOW_SMALL_MAP;

TEST(MapScene, HasTheMapInTheFormThatPagesRead) {
  MapScene scene;
  scene.show(kMap);
  const auto bytes = scene.bytes();
  ASSERT_TRUE(bytes) << bytes.error().message;
  const std::string& data = **bytes;
  ASSERT_GE(data.size(), 24U);
  EXPECT_EQ(data.substr(0, 4), "GFVM");
  std::array<std::uint32_t, 5> head{};
  std::memcpy(head.data(), data.data() + 4, sizeof head);
  const auto [version, keyframes, points, surfels, loops] = head;
  EXPECT_EQ(version, 1U);
  EXPECT_GT(keyframes, 0U);
  EXPECT_EQ(data.size(), 24U + 4U * (7U * keyframes + 3U * points + 6U * surfels + 6U * loops));
  std::array<float, 7> pose{};
  std::memcpy(pose.data(), data.data() + 24, sizeof pose);
  const float norm = pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6];
  EXPECT_NEAR(norm, 1, 1e-5);
  EXPECT_EQ(scene.bytes().value(), *bytes) << "read once";
}

TEST(MapScene, SaysWhatCannotBeShown) {
  MapScene scene;
  ASSERT_FALSE(scene.bytes());
  EXPECT_THAT(scene.bytes().error().message, HasSubstr("no map has been saved yet"));
  const geoflow::tests::TemporaryDirectory folder;
  const auto damaged = folder.path() / "damaged.map";
  std::ofstream{damaged} << "GFLOWMAP and no more";
  scene.show(damaged);
  ASSERT_FALSE(scene.bytes());
  EXPECT_THAT(scene.bytes().error().message, HasSubstr("damaged.map"));
  scene.show(kMap);
  EXPECT_TRUE(scene.bytes());
}

}  // namespace
}  // namespace geoflow::tools
