#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "tests/support/data.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/map_correction.hpp"
#include "slam/storage/small_map.hpp"
#include "storage/stored_map.hpp"

namespace geoflow::slam {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::HasSubstr;
using tests::read_bytes;
using tests::small_map;
using tests::write_bytes;

class MapFileTest : public testing::Test {
 protected:
  /// What is wrong with a file of these bytes; empty: nothing.
  [[nodiscard]] std::string wrong_with(const std::string& bytes) const {
    write_bytes(path_, bytes);
    const auto map = load_map(path_);
    const auto checked = map ? check_depth(**map) : Result<void>{};
    return !map ? map.error().message : (checked ? "" : checked.error().message);
  }

  TemporaryDirectory folder_;
  std::filesystem::path path_ = folder_.path() / "test.map";
};

TEST_F(MapFileTest, ComesBackAsItWasToTheLastBit) {
  ASSERT_TRUE(save_map(small_map("one"), path_));
  const std::string first = read_bytes(path_);
  const auto map = load_map(path_);
  ASSERT_TRUE(map) << map.error().message;
  ASSERT_TRUE(check_depth(**map));
  ASSERT_TRUE(save_map(**map, path_));
  EXPECT_EQ(read_bytes(path_), first);

  const MapContents expected = small_map("one").contents;
  const MapContents& contents = (*map)->contents;
  ASSERT_EQ(contents.keyframes.size(), expected.keyframes.size());
  for (const auto& [id, keyframe] : expected.keyframes) {
    const Keyframe& loaded = contents.keyframes.at(id);
    EXPECT_EQ(loaded.t, keyframe.t);
    EXPECT_EQ(loaded.part, keyframe.part);
    EXPECT_EQ(loaded.covariance, keyframe.covariance);
    EXPECT_EQ(loaded.T_odom_cam.translation(), keyframe.T_odom_cam.translation());
    EXPECT_EQ(loaded.points, keyframe.points);
    EXPECT_EQ(loaded.place->features.front().descriptor,
              keyframe.place->features.front().descriptor);
    EXPECT_EQ(loaded.place->p_cam, keyframe.place->p_cam);
    EXPECT_FALSE(loaded.cloud) << "depth stays in the file";
    const auto cloud = loaded.stored_cloud->read();
    ASSERT_TRUE(cloud) << cloud.error().message;
    EXPECT_EQ((*cloud)->sigma(), keyframe.cloud->sigma());
    ASSERT_EQ((*cloud)->size(), keyframe.cloud->size());
    for (const std::uint32_t cell : (*cloud)->valid()) {
      EXPECT_EQ((*cloud)->surfels()[cell].point, keyframe.cloud->surfels()[cell].point);
    }
  }
  EXPECT_EQ(contents.points.size(), expected.points.size());
  EXPECT_EQ(contents.edges.size(), expected.edges.size());
  EXPECT_EQ(contents.joins.size(), expected.joins.size());
}

TEST_F(MapFileTest, CutAnywhereItIsRefusedWithTheReason) {
  ASSERT_TRUE(save_map(small_map("one"), path_));
  const std::string whole = read_bytes(path_);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_THAT(wrong_with(whole.substr(0, length)), HasSubstr(path_.string())) << length;
  }
  EXPECT_THAT(wrong_with(whole + '\0'), HasSubstr("should have"));
}

TEST_F(MapFileTest, OneWrongBitAnywhereIsFound) {
  ASSERT_TRUE(save_map(small_map("one"), path_));
  std::string bytes = read_bytes(path_);
  constexpr std::array<char, 3> kFlips{1, 0x10, static_cast<char>(0x80)};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char flip = kFlips.at(i % kFlips.size());
    bytes[i] = static_cast<char>(bytes[i] ^ flip);
    EXPECT_THAT(wrong_with(bytes), HasSubstr(path_.string())) << i;
    bytes[i] = static_cast<char>(bytes[i] ^ flip);
  }
}

TEST_F(MapFileTest, SaysWhichFileIsNotThere) {
  const auto map = load_map(path_);
  ASSERT_FALSE(map);
  EXPECT_EQ(map.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(map.error().message, HasSubstr(path_.string()));
}

TEST_F(MapFileTest, IsTakenOnlyByTheCameraThatMadeIt) {
  const StoredMap map = small_map("one");
  Calibration calibration = map.identity.calibration;
  EXPECT_TRUE(made_with(map, calibration));
  calibration.serial = "";
  EXPECT_TRUE(made_with(map, calibration)) << "nothing is known to the contrary";
  calibration.serial = "4567";
  EXPECT_THAT(made_with(map, calibration).error().message, HasSubstr("4567"));
  calibration = map.identity.calibration;
  calibration.camera.fx += 1;
  EXPECT_THAT(made_with(map, calibration).error().message, HasSubstr("calibration of the camera"));
  calibration = map.identity.calibration;
  calibration.T_base_cam = SE3{};
  EXPECT_THAT(made_with(map, calibration).error().message, HasSubstr("on the robot"));
}

TEST_F(MapFileTest, UnreadDepthIsSavedAgainWhenTheOldFileIsGone) {
  ASSERT_TRUE(save_map(small_map("one"), path_));
  const auto map = load_map(path_);
  ASSERT_TRUE(map);
  std::filesystem::remove(path_);
  const auto copy = folder_.path() / "copy.map";
  ASSERT_TRUE(save_map(**map, copy));
  EXPECT_TRUE(check_depth(**load_map(copy)));
}

TEST(Map, PartsGetOneFrameWhenAPlaceTiesThem) {
  MapContents saved = small_map("one").contents;
  Map map{saved};
  const KeyframeId old = saved.keyframes.begin()->first;
  Keyframe keyframe;
  const KeyframeId before = map.add_keyframe(keyframe);
  keyframe.T_odom_cam = SE3{Eigen::Quaterniond::Identity(), {1, 0, 0}};
  const KeyframeId seen_again = map.add_keyframe(keyframe);
  EXPECT_FALSE(map.same_part(old, seen_again));
  EXPECT_TRUE(map.begins_thread(before));
  EXPECT_FALSE(map.begins_thread(seen_again));
  EXPECT_EQ(pose_graph(map).nodes.size(), 2U) << "parts are kept apart";

  const SE3 T_old_new{Eigen::Quaterniond::Identity(), {0, 0.5, 0}};
  const SE3 T_odom1_odom0 = map.join(
      {.from = old, .to = seen_again, .T_from_to = T_old_new, .information = Matrix6d::Identity()});
  EXPECT_TRUE(map.same_part(old, before));
  EXPECT_EQ(map.newest_part(), map.keyframe(old).part);
  const SE3& T_odom_old = map.keyframe(old).T_odom_cam;
  const SE3& T_odom_new = map.keyframe(seen_again).T_odom_cam;
  EXPECT_LT((T_old_new.inverse() * (T_odom_old.inverse() * T_odom_new)).log().norm(), 1e-9);
  const SE3& T_odom_before = map.keyframe(before).T_odom_cam;
  EXPECT_LT((T_odom_before.inverse() * T_odom1_odom0).log().norm(), 1e-9) << "moved along";
  EXPECT_EQ(T_odom_old.translation(), saved.keyframes.at(old).T_odom_cam.translation());
  const PoseGraphProblem graph = pose_graph(map);
  EXPECT_EQ(graph.nodes.size(), saved.keyframes.size() + 2);
  EXPECT_EQ(graph.way.size(), graph.nodes.size() - 1) << "a way through all";
}

}  // namespace
}  // namespace geoflow::slam
