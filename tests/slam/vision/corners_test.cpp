#include "vision/corners.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "slam/vision/textured_wall.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {
namespace {

using Cell = std::pair<int, int>;

std::map<Cell, int> per_cell(const std::vector<cv::KeyPoint>& corners, int cell_px) {
  std::map<Cell, int> count;
  for (const cv::KeyPoint& corner : corners) {
    ++count[{static_cast<int>(corner.pt.x) / cell_px, static_cast<int>(corner.pt.y) / cell_px}];
  }
  return count;
}

TEST(Corners, FillTheGridAndNoCellBeyondItsShare) {
  const FeatureConfig config;
  const cv::Mat1b image = TexturedWall{2.0, 1}.seen_from(SE3{});
  const auto count = per_cell(detect_corners(image, config), config.cell_px);
  EXPECT_EQ(count.size(), 48U);  // 8 x 6 cells
  for (const auto& [cell, n] : count) {
    EXPECT_LE(n, config.described_per_cell) << cell.first << ' ' << cell.second;
  }
}

TEST(Corners, AreFoundWhereContrastIsFaintAndOnlyThere) {
  const FeatureConfig config;
  const cv::Mat1b image = TexturedWall{2.0, 1}.seen_from(SE3{});
  const cv::Mat1b left = image(cv::Rect{0, 0, 160, 240});
  left.convertTo(left, CV_8U, 0.15, 110);
  const auto corners = detect_corners(image, config);
  const auto faint = std::ranges::count_if(
      corners, [](const cv::KeyPoint& corner) { return corner.response < 20; });
  EXPECT_GT(faint, 10);
  EXPECT_TRUE(std::ranges::is_sorted(corners, [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.response > b.response;
  }));
  for (const cv::KeyPoint& corner : corners) {
    EXPECT_GE(corner.response, static_cast<float>(config.fast_threshold));
  }
  EXPECT_TRUE(detect_corners(cv::Mat1b(240, 320, static_cast<unsigned char>(90)), config).empty());
}

TEST(Corners, AreNoneInAnImageSmallerThanAPatch) {
  EXPECT_TRUE(
      detect_corners(TexturedWall{2.0, 1}.seen_from(SE3{})(cv::Rect{0, 0, 24, 200}), {}).empty());
}

TEST(Corners, TurnWithTheImage) {
  const FeatureConfig config{.described_per_cell = 1000};  // all there are
  const cv::Mat1b image = TexturedWall{2.0, 3}.seen_from(SE3{});
  cv::Mat1b turned;
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  const auto before = detect_corners(image, config);
  const auto after = detect_corners(turned, config);
  std::size_t same_place = 0;
  std::size_t same_angle = 0;
  for (const cv::KeyPoint& a : before) {
    const cv::Point2f expected{static_cast<float>(image.rows) - 1 - a.pt.y, a.pt.x};
    for (const cv::KeyPoint& b : after) {
      if (a.octave == 0 && b.octave == 0 && cv::norm(b.pt - expected) < 0.5) {
        ++same_place;
        const double off = std::remainder(static_cast<double>(b.angle - a.angle) - 90, 360.0);
        same_angle += std::abs(off) < 1 ? 1U : 0U;
      }
    }
  }
  EXPECT_GT(same_place, 20U);
  EXPECT_EQ(same_angle, same_place);
}

TEST(OrbFeatures, OfOneWallAreMatchedBetweenTwoViewsOfIt) {
  const TexturedWall wall{2.0, 5};
  const CameraModel camera{wall_camera()};
  const SE3 T_odom_a;
  const SE3 T_odom_b{
      Eigen::Quaterniond{Eigen::AngleAxisd{0.15, Vector3d{0.2, 0.3, 1}.normalized()}},
      Vector3d{0.08, -0.05, 0.1}};
  OrbExtractor orb{{}};
  const auto in_a = orb.extract(wall.seen_from(T_odom_a));
  const auto in_b = orb.extract(wall.seen_from(T_odom_b));
  std::vector<ExpectedFeature> expected;
  for (const OrbFeature& feature : in_a) {
    const Vector3d p_odom = wall.point_at(T_odom_a, feature.pixel);
    expected.push_back({camera.project(T_odom_b.inverse() * p_odom), feature.descriptor});
  }
  constexpr double kRadiusPx = 15;
  const auto match = match_by_projection(expected, in_b, kRadiusPx);
  int right = 0;
  int wrong = 0;
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0) {
      const Vector2d& found = in_b[static_cast<std::size_t>(match[i])].pixel;
      ((found - expected[i].pixel).norm() < 3 ? right : wrong) += 1;
    }
  }
  EXPECT_GT(right, 40);
  EXPECT_LT(wrong, right / 10);
}

TEST(OrbFeatures, ToTrackKeepAwayFromThoseTracked) {
  const FeatureConfig config;
  const cv::Mat1b image = TexturedWall{2.0, 5}.seen_from(SE3{});
  OrbExtractor orb{config};
  const auto all = orb.extract(image);
  const std::vector<Vector2d> taken{{100, 100}, {319, 239}, {0, 0}};
  const auto chosen = choose_new(all, taken, image.size(), config);
  EXPECT_GT(chosen.size(), 40U);
  EXPECT_LE(chosen.size(), 48U * static_cast<std::size_t>(config.features_per_cell));
  for (const OrbFeature& feature : chosen) {
    for (const Vector2d& pixel : taken) {
      EXPECT_GT((feature.pixel - pixel).cwiseAbs().maxCoeff(), config.mask_radius_px);
    }
    for (const OrbFeature& other : chosen) {
      const double apart_px = (feature.pixel - other.pixel).cwiseAbs().maxCoeff();
      EXPECT_TRUE(apart_px == 0 || apart_px > config.mask_radius_px - 1) << apart_px;
    }
  }
}

}  // namespace
}  // namespace geoflow::slam
