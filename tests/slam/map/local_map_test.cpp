#include "map/local_map.hpp"

#include <cstdint>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"

namespace geoflow::slam {
namespace {

/// A hundred keyframes in a row, tied to nothing.
class LocalMapTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i <= static_cast<int>(kNewest); ++i) {
      map_.add_keyframe(Keyframe{});
    }
  }
  [[nodiscard]] bool contains(std::uint32_t id) const {
    return LocalMap{map_, KeyframeId{kNewest}}.contains(KeyframeId{id});
  }
  void tie(std::uint32_t from, std::uint32_t to) {
    map_.add_edge({.from = KeyframeId{from},
                   .to = KeyframeId{to},
                   .T_from_to = SE3{},
                   .information = Matrix6d::Identity()});
  }
  /// Both see `count` new points.
  void share_points(std::uint32_t a, std::uint32_t b, int count) {
    for (int i = 0; i < count; ++i) {
      const PointId point =
          map_.add_point({.p_odom = {0, 0, 1}, .descriptor = {}, .observations = {}});
      map_.observe(point, {.keyframe = KeyframeId{a}, .pixel = {0, 0}, .depth_m = 1});
      map_.observe(point, {.keyframe = KeyframeId{b}, .pixel = {0, 0}, .depth_m = 1});
    }
  }

  static constexpr std::uint32_t kNewest = 99;
  Map map_;
};

TEST_F(LocalMapTest, IsTheNewestKeyframesWhereNothingTiesThemToOthers) {
  EXPECT_TRUE(contains(kNewest));
  EXPECT_TRUE(contains(kNewest - 20));
  EXPECT_FALSE(contains(kNewest - 21));
  EXPECT_FALSE(contains(0));
}

TEST_F(LocalMapTest, ReachesWhereAnEdgeOfTheNewestFewLeads) {
  tie(30, kNewest - 4);
  EXPECT_TRUE(contains(30));
  EXPECT_TRUE(contains(20));
  EXPECT_TRUE(contains(40));
  EXPECT_FALSE(contains(19));
  EXPECT_FALSE(contains(41));
}

TEST_F(LocalMapTest, DoesNotFollowTheEdgesOfKeyframesLongAgo) {
  tie(30, kNewest - 5);
  tie(30, 35);
  EXPECT_FALSE(contains(30));
}

TEST_F(LocalMapTest, ReachesKeyframesThatSeeEnoughOfTheSamePoints) {
  share_points(30, kNewest, 14);
  EXPECT_FALSE(contains(30));
  share_points(30, kNewest - 1, 1);
  EXPECT_TRUE(contains(30));
}

}  // namespace
}  // namespace geoflow::slam
