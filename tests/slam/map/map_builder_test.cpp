#include "map/map_builder.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/mapping_problem.hpp"
#include "odometry/frame.hpp"
#include "slam/vision/textured_wall.hpp"
#include "vision/camera_model.hpp"
#include "vision/dual_stream_flow.hpp"

/// Keyframes of a textured wall that the camera has no depth of.
namespace geoflow::slam {
namespace {

class MapBuilderTest : public testing::Test {
 protected:
  /// The frame at a pose, with the features of `previous` followed into it.
  Frame frame_at(const SE3& T_odom_cam, const Frame* previous = nullptr) const {
    const FlowConfig flow;
    Frame frame;
    frame.T_odom_cam = T_odom_cam;
    frame.pyramid = std::make_shared<const ImagePyramid>(wall_.seen_from(T_odom_cam),
                                                         flow.window_px, flow.levels);
    if (previous != nullptr) {
      std::vector<FlowSeed> seeds;
      seeds.reserve(previous->features.size());
      for (const Feature& feature : previous->features) {
        seeds.push_back({.previous = feature.raw, .predicted = std::nullopt});
      }
      const auto tracks =
          DualStreamFlow{flow, camera_}.track(*previous->pyramid, *frame.pyramid, seeds);
      for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (tracks[i]) {
          Feature feature = previous->features[i];
          feature.raw = *tracks[i];
          feature.ideal = *tracks[i];
          frame.features.push_back(feature);
        }
      }
    }
    return frame;
  }

  static constexpr double kWallM = 2.0;
  TexturedWall wall_{kWallM, 11};
  CameraModel camera_{wall_camera()};
  MapBuilder builder_{
      {}, {}, {.camera = wall_camera(), .source = "the test", .serial = {}}, nullptr};
  Map map_;
};

TEST_F(MapBuilderTest, FeaturesWithoutDepthBecomePointsOnceTheCameraHasMovedEnough) {
  Frame a = frame_at(SE3{});
  builder_.insert(map_, a, Matrix6d::Zero());
  EXPECT_GT(a.features.size(), 60U);
  EXPECT_TRUE(map_.points().empty());

  // 1 cm aside is half the least parallax at 2 m.
  Frame b = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{0.01, 0, 0}}, &a);
  builder_.insert(map_, b, Matrix6d::Zero());
  EXPECT_TRUE(map_.points().empty());

  Frame c = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{0.12, 0, 0}}, &b);
  const KeyframeId third = builder_.insert(map_, c, Matrix6d::Zero());
  ASSERT_GT(map_.points().size(), 50U);
  std::size_t near = 0;
  for (const auto& [id, point] : map_.points()) {
    EXPECT_EQ(point.observations.size(), 2U);
    EXPECT_EQ(point.observations.back().keyframe, third);
    // 0.2 px of each track, over a parallax of 0.06 rad: 4 % of the distance at three sigma.
    near += std::abs(point.p_odom.z() - 2.0) < 0.08 ? 1U : 0U;
  }
  EXPECT_GT(near, map_.points().size() * 95 / 100);
}

TEST_F(MapBuilderTest, TheAdjustmentSeesEveryKeyframeAndHoldsAtLeastOne) {
  Frame frame = frame_at(SE3{});
  KeyframeId newest = builder_.insert(map_, frame, Matrix6d::Zero());
  for (int i = 1; i <= 3; ++i) {
    Frame next = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{0.1 * i, 0, 0}}, &frame);
    newest = builder_.insert(map_, next, Matrix6d::Zero());
    frame = next;
  }
  const auto problem = builder_.task(map_, newest).problem;
  ASSERT_EQ(problem->keyframes.size(), 4U);
  EXPECT_TRUE(problem->keyframes.front().fixed);
  EXPECT_FALSE(problem->keyframes.back().fixed);
  EXPECT_GT(problem->points.size(), 50U);
  for (const MappingPoint& point : problem->points) {
    EXPECT_GE(point.observations.size(), 2U);
  }
}

// Held keyframes are those with the most in common; the one before the window may not be among
// them. Without it nothing may tell how far the window is along a floor or a corridor.
TEST_F(MapBuilderTest, TheAdjustmentHoldsWhatTheWindowIsReckonedFrom) {
  constexpr int kKeyframes = 25;
  const Config config;
  Frame frame = frame_at(SE3{});
  KeyframeId newest = builder_.insert(map_, frame, Matrix6d::Zero());
  for (int i = 1; i < kKeyframes; ++i) {
    Frame next;  // sees nothing that another has seen
    next.T_odom_cam = SE3{Eigen::Quaterniond::Identity(), Vector3d{0.1 * i, 0, 0}};
    next.pyramid = frame.pyramid;
    const KeyframeId before = newest;
    newest = builder_.insert(map_, next, Matrix6d::Zero());
    map_.keyframe(newest).reckoned = RelativeEdge{
        .from = before, .to = newest, .T_from_to = SE3{}, .information = Matrix6d::Identity()};
    map_.add_edge(*map_.keyframe(newest).reckoned);
  }
  // As many old keyframes as are held are tied to the window more firmly than the one before it.
  for (int i = 0; i < config.mapping.fixed; ++i) {
    for (int times = 0; times < 2; ++times) {
      map_.add_edge({.from = std::next(map_.keyframes().begin(), i)->first,
                     .to = newest,
                     .T_from_to = SE3{},
                     .information = Matrix6d::Zero()});
    }
  }
  const auto problem = builder_.task(map_, newest).problem;
  const auto oldest_moving =
      std::ranges::find_if(problem->keyframes, [](const auto& k) { return !k.fixed; });
  ASSERT_NE(oldest_moving, problem->keyframes.end());
  const KeyframeId from = map_.keyframe(oldest_moving->id).reckoned->from;
  EXPECT_TRUE(std::ranges::any_of(problem->keyframes,
                                  [&](const auto& k) { return k.fixed && k.id == from; }));
}

// As after a loop: what each keyframe sees of the wall is right, where the map has them is not.
TEST_F(MapBuilderTest, TheAdjustmentOfTheWholeMapMovesAllKeyframesButTheOldest) {
  constexpr int kKeyframes = 30;  // three times the window of a local one
  constexpr double kStepM = 0.1;
  constexpr double kStretched = 1.05;
  const SE3 T_odom_start;
  Frame frame = frame_at(T_odom_start);
  std::vector<KeyframeId> ids{builder_.insert(map_, frame, Matrix6d::Zero())};
  for (int i = 1; i < kKeyframes; ++i) {
    Frame next = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{kStepM * i, 0, 0}}, &frame);
    for (Feature& feature : next.features) {
      feature.depth_m = kWallM;
    }
    next.T_odom_cam = SE3{Eigen::Quaterniond::Identity(), Vector3d{kStretched * kStepM * i, 0, 0}};
    ids.push_back(builder_.insert(map_, next, Matrix6d::Zero()));
    frame = next;
  }
  const MappingTask task = builder_.whole_map_task(map_);
  ASSERT_EQ(task.problem->keyframes.size(), ids.size());
  EXPECT_TRUE(task.problem->keyframes.front().fixed);
  EXPECT_EQ(std::ranges::count_if(task.problem->keyframes, &MappingKeyframe::fixed), 1);

  const MappingResult result = optimise(task);
  ASSERT_NE(result.solution, nullptr);
  EXPECT_TRUE(result.solution->whole_map);
  const SE3 T_odom1_odom0 = builder_.apply(map_, *result.solution);
  const double too_far = (kStretched - 1) * kStepM * (kKeyframes - 1);
  EXPECT_NEAR(T_odom1_odom0.translation().x(), -too_far, 0.1 * too_far);
  for (int i = 0; i < kKeyframes; ++i) {
    const double x = map_.keyframe(ids[static_cast<std::size_t>(i)]).T_odom_cam.translation().x();
    EXPECT_NEAR(x, kStepM * i, 0.1 * too_far) << i;
  }
}

// A gyroscope whose bias has wandered by 0.3 degrees a second since the robot stood.
TEST_F(MapBuilderTest, WhatIsSeenTellsTheGyroscopesBias) {
  constexpr int kKeyframes = 8;
  constexpr double kApartS = 0.25;
  constexpr double kStepM = 0.1;
  const Vector3d bias{0, 0.005, -0.002};
  Matrix6d information = 1e6 * Matrix6d::Identity();
  information.bottomRightCorner<3, 3>() *= 0.1;
  Frame frame = frame_at(SE3{});
  KeyframeId newest = builder_.insert(map_, frame, Matrix6d::Zero());
  for (int i = 1; i < kKeyframes; ++i) {
    const SE3 T_before_this{Eigen::Quaterniond::Identity(), Vector3d{kStepM, 0, 0}};
    Frame next = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{kStepM * i, 0, 0}}, &frame);
    for (Feature& feature : next.features) {
      feature.depth_m = kWallM;
    }
    const KeyframeId before = newest;
    newest = builder_.insert(map_, next, Matrix6d::Zero());
    // What a reckoner says that knows nothing of the bias: the camera is the imu here.
    const SE3 T_turned{so3::exp(kApartS * bias), Vector3d::Zero()};
    map_.add_edge({.from = before,
                   .to = newest,
                   .T_from_to = T_before_this * T_turned,
                   .information = information,
                   .kind = EdgeKind::kReckoned});
    map_.keyframe(newest).gyro = {.duration_s = kApartS,
                                  .per_bias = -kApartS * Matrix3d::Identity(),
                                  .bias_covariance = 1e-4 * Matrix3d::Identity()};
    frame = next;
  }
  const MappingResult result = optimise(builder_.task(map_, newest));
  ASSERT_NE(result.solution, nullptr);
  ASSERT_EQ(result.solution->gyro_bias.size(), static_cast<std::size_t>(kKeyframes) - 1);
  (void)builder_.apply(map_, *result.solution);
  const Vector3d error = map_.keyframe(newest).gyro.bias - bias;
  EXPECT_LT(error.norm(), 0.1 * bias.norm()) << error.transpose();
}

// Where a keyframe is corrected by much, a point that it saw may come to lie behind it.
TEST_F(MapBuilderTest, APointBehindTheCameraDoesNotKeepTheRestFromBeingAdjusted) {
  constexpr int kKeyframes = 4;
  constexpr double kStepM = 0.1;
  constexpr double kOffM = 0.03;
  Frame frame = frame_at(SE3{});
  KeyframeId newest = builder_.insert(map_, frame, Matrix6d::Zero());
  for (int i = 1; i < kKeyframes; ++i) {
    Frame next = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{kStepM * i, 0, 0}}, &frame);
    for (Feature& feature : next.features) {
      feature.depth_m = kWallM;
    }
    newest = builder_.insert(map_, next, Matrix6d::Zero());
    frame = next;
  }
  SE3& T_odom_cam = map_.keyframe(newest).T_odom_cam;
  T_odom_cam = T_odom_cam * SE3{Eigen::Quaterniond::Identity(), Vector3d{kOffM, 0, 0}};
  const PointId behind = map_.keyframe(newest).points.front();
  map_.find_point(behind)->p_odom = Vector3d{0, 0, -1};

  const MappingResult result = optimise(builder_.task(map_, newest));
  ASSERT_NE(result.solution, nullptr);
  EXPECT_NEAR(result.solution->T_odom_cam.at(newest).translation().x(), kStepM * (kKeyframes - 1),
              0.1 * kOffM);
  EXPECT_TRUE(std::ranges::any_of(result.solution->outliers,
                                  [&](const auto& o) { return o.first == behind; }));
}

TEST_F(MapBuilderTest, PointsThatAreSeldomWhereTheyShouldBeAreForgotten) {
  Frame a = frame_at(SE3{});
  builder_.insert(map_, a, Matrix6d::Zero());
  Frame b = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{0.12, 0, 0}}, &a);
  builder_.insert(map_, b, Matrix6d::Zero());
  ASSERT_GT(map_.points().size(), 2U);
  const PointId bad = map_.points().begin()->first;
  const PointId good = map_.points().rbegin()->first;
  map_.find_point(bad)->expected = map_.find_point(good)->expected = 10;
  map_.find_point(bad)->found = 4;
  map_.find_point(good)->found = 6;
  Frame c = frame_at(SE3{Eigen::Quaterniond::Identity(), Vector3d{0.14, 0, 0}}, &b);
  builder_.insert(map_, c, Matrix6d::Zero());
  EXPECT_EQ(map_.find_point(bad), nullptr);
  EXPECT_NE(map_.find_point(good), nullptr);
}

}  // namespace
}  // namespace geoflow::slam
