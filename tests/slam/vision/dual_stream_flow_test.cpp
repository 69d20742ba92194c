#include "vision/dual_stream_flow.hpp"

#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "slam/vision/textured_wall.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/orb_features.hpp"
#include "vision/patch_alignment.hpp"

namespace geoflow::slam {
namespace {

/// Two views of a wall and its corners in the first.
struct Views {
  explicit Views(const SE3& moved, double step_m = 0) : wall{2.0, 7, step_m}, T_odom_b{moved} {
    const cv::Mat1b image = wall.seen_from(SE3{});
    OrbExtractor orb{{}};
    for (const OrbFeature& feature : choose_new(orb.extract(image), {}, image.size(), {})) {
      const Vector2d& pixel = feature.pixel;
      const Vector2d in_b = camera.project(T_odom_b.inverse() * wall.point_at(SE3{}, pixel));
      if (camera.contains(in_b, 12)) {
        seeds.push_back({.previous = pixel, .predicted = std::nullopt});
        truth.push_back(in_b);
      }
    }
  }
  [[nodiscard]] ImagePyramid pyramid(const SE3& T_odom_cam) const {
    const FlowConfig flow;
    return {wall.seen_from(T_odom_cam), flow.window_px, flow.levels};
  }
  [[nodiscard]] std::vector<std::optional<Vector2d>> tracked() const {
    return DualStreamFlow{{}, camera}.track(pyramid(SE3{}), pyramid(T_odom_b), seeds);
  }
  /// Tracks that end within `px` of the truth, and all tracks.
  [[nodiscard]] std::pair<std::size_t, std::size_t> within(double px) const {
    std::size_t right = 0;
    std::size_t all = 0;
    const auto tracks = tracked();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      all += tracks[i] ? 1U : 0U;
      right += tracks[i] && (*tracks[i] - truth[i]).norm() < px ? 1U : 0U;
    }
    return {right, all};
  }

  TexturedWall wall;
  CameraModel camera{wall_camera()};
  SE3 T_odom_b;
  std::vector<FlowSeed> seeds;
  std::vector<Vector2d> truth;
};

const SE3 small_step{
    Eigen::Quaterniond{Eigen::AngleAxisd{0.02, Vector3d{0.5, -1, 0.3}.normalized()}},
    Vector3d{0.02, 0.01, 0.03}};

TEST(DualStreamFlow, FollowsTheCornersOfAWallToAFractionOfAPixel) {
  const Views views{small_step};
  ASSERT_GT(views.seeds.size(), 80U);
  const auto [right, all] = views.within(0.3);
  EXPECT_GT(all, views.seeds.size() * 8 / 10);
  EXPECT_GT(right, all * 95 / 100);
}

TEST(DualStreamFlow, APredictionCarriesItOverAStepThatIsTooLongWithout) {
  const SE3 far{Eigen::Quaterniond{Eigen::AngleAxisd{0.25, Vector3d{0, 1, 0}}},
                Vector3d{0.05, 0, 0}};
  Views views{far};
  ASSERT_GT(views.seeds.size(), 50U);
  const std::size_t without = views.within(0.5).first;
  for (std::size_t i = 0; i < views.seeds.size(); ++i) {
    views.seeds[i].predicted = views.truth[i] + Vector2d{3, -2};
  }
  const auto [right, all] = views.within(0.5);
  EXPECT_GT(right, views.seeds.size() * 7 / 10);
  EXPECT_GT(right, all * 95 / 100);
  EXPECT_LT(without, right / 2);
}

TEST(DualStreamFlow, DropsWhatMovesAgainstTheCamera) {
  // Sideways past two depths, which settles the epipolar geometry; the middle of the second view
  // shows something that moved upward on its own.
  const Views views{SE3{Eigen::Quaterniond::Identity(), Vector3d{0.1, 0, 0.02}}, 0.8};
  const cv::Mat1b second = views.wall.seen_from(views.T_odom_b);
  const cv::Rect moving{90, 60, 120, 120};
  const cv::Mat1b elsewhere = second(moving + cv::Point{0, 9}).clone();
  elsewhere.copyTo(second(moving));
  const FlowConfig flow;
  const auto tracks = DualStreamFlow{flow, views.camera}.track(
      views.pyramid(SE3{}), ImagePyramid{second, flow.window_px, flow.levels}, views.seeds);
  std::size_t in_moving = 0;
  std::size_t seeds_in_moving = 0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const cv::Point2d at{views.truth[i].x(), views.truth[i].y()};
    const bool inside = cv::Rect2d{moving}.contains(at);
    seeds_in_moving += inside ? 1U : 0U;
    in_moving += inside && tracks[i] ? 1U : 0U;
  }
  EXPECT_GT(seeds_in_moving, 12U);
  EXPECT_LT(in_moving, seeds_in_moving / 4);
}

TEST(DualStreamFlow, LetsNoTwoTracksEndAtOnePlace) {
  Views views{small_step};
  const std::size_t n = views.seeds.size();
  for (std::size_t i = 0; i < n; ++i) {
    views.seeds.push_back(views.seeds[i]);
    views.truth.push_back(views.truth[i]);
  }
  const auto tracks = views.tracked();
  for (std::size_t i = 0; i < n; ++i) {
    EXPECT_FALSE(tracks[i] && tracks[i + n]) << i;
  }
}

TEST(DualStreamFlow, TakesTheWordOfWhatLooksForAPatch) {
  // Of three seeds one is found 3 px from where flow has it, which no check would pass, one is not
  // there, though flow has it, and one cannot be told.
  const Views views{small_step};
  const auto by_flow = views.tracked();
  const auto look_for = [&](std::size_t i, const Vector2d& pixel) {
    EXPECT_LT((pixel - views.truth[i]).norm(), 20) << i;
    return PatchSearch{.result = static_cast<PatchSearch::Result>(i % 3),
                       .pixel = pixel + Vector2d{0, 3}};
  };
  FlowConfig flow;
  flow.fundamental_threshold_px = 10;
  const auto tracks = DualStreamFlow{flow, views.camera}.track(
      views.pyramid(SE3{}), views.pyramid(views.T_odom_b), views.seeds, look_for);
  std::map<PatchSearch::Result, std::size_t> followed;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (tracks[i] && by_flow[i]) {
      const auto result = static_cast<PatchSearch::Result>(i % 3);
      const Vector2d by = *tracks[i] - *by_flow[i];
      EXPECT_NEAR(by.y(), result == PatchSearch::Result::kFound ? 3 : 0, 0.01) << i;
      ++followed[result];
    }
  }
  EXPECT_GT(followed[PatchSearch::Result::kFound], views.seeds.size() / 6);
  EXPECT_GT(followed[PatchSearch::Result::kUnknown], views.seeds.size() / 6);
  EXPECT_EQ(followed[PatchSearch::Result::kNotThere], 0U);
}

TEST(DualStreamFlow, TakesNoWiderWindowFromAPredictionThanThePyramidsHaveRoomFor) {
  Views views{small_step};
  for (std::size_t i = 0; i < views.seeds.size(); ++i) {
    views.seeds[i].predicted = views.truth[i];
  }
  FlowConfig wide;
  wide.prior_window_px = 2 * wide.window_px + 1;
  FlowConfig same;
  same.prior_window_px = same.window_px;
  const auto track = [&](const FlowConfig& flow) {
    return DualStreamFlow{flow, views.camera}.track(views.pyramid(SE3{}),
                                                    views.pyramid(views.T_odom_b), views.seeds);
  };
  EXPECT_EQ(track(wide), track(same));
}

TEST(DualStreamFlow, OfNothingIsNothing) {
  const Views views{small_step};
  EXPECT_TRUE(DualStreamFlow({}, views.camera)
                  .track(views.pyramid(SE3{}), views.pyramid(SE3{}), {})
                  .empty());
}

}  // namespace
}  // namespace geoflow::slam
