#include "odometry/patch_refiner.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "slam/vision/textured_wall.hpp"
#include "vision/dual_stream_flow.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/orb_features.hpp"
#include "vision/patch_alignment.hpp"

/// A camera low above a floor, as a robot dog's: what is ahead is seen at a slant.
namespace geoflow::slam {
namespace {

constexpr double kHeightM = 0.4;
constexpr double kStepM = 0.02;

class PatchRefinerTest : public testing::Test {
 protected:
  /// After so many steps forward; odom's z points down into the floor.
  static SE3 pose(int steps) {
    constexpr double kTilt = 65 * std::numbers::pi / 180;
    return {Eigen::Quaterniond{Eigen::AngleAxisd{kTilt, Vector3d::UnitX()}},
            Vector3d{0, -kStepM * steps, 0}};
  }
  [[nodiscard]] std::shared_ptr<const ImagePyramid> pyramid(int steps) const {
    const FlowConfig flow;
    return std::make_shared<const ImagePyramid>(floor_.seen_from(pose(steps)), flow.window_px,
                                                flow.levels);
  }
  /// Exact depth, as far as `farthest_m`.
  [[nodiscard]] std::shared_ptr<const DepthCloud> cloud(double farthest_m) const {
    constexpr double kUnitM = 1e-4;
    FramePool pool{1};
    const CameraIntrinsics& k = camera_.intrinsics();
    FrameRef depth = pool.acquire({k.width, k.height, PixelFormat::kDepth16});
    const SE3 T_cam_odom = pose(0).inverse();
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const double z = (T_cam_odom * floor_.point_at(pose(0), Vector2d{u, v})).z();
        const auto count = static_cast<std::uint16_t>(z < farthest_m ? std::lround(z / kUnitM) : 0);
        const int in_row_order = v * k.width + u;
        const auto index = static_cast<std::size_t>(in_row_order) * sizeof(count);
        std::memcpy(depth.writable_bytes().subspan(index).data(), &count, sizeof(count));
      }
    }
    const auto grid = CellGrid::create(k, DepthCloudConfig{}.cell_px);
    auto made = std::make_shared<DepthCloud>(*grid, DepthCloud::Pixels{kUnitM}, DepthCloudConfig{});
    EXPECT_TRUE(made->build(depth));
    return made;
  }
  /// A keyframe of the floor with its corners as points.
  void look(double farthest_m) {
    first_ = pyramid(0);
    const KeyframeId keyframe = map_.add_keyframe({.t = {},
                                                   .T_odom_cam = pose(0),
                                                   .cloud = cloud(farthest_m),
                                                   .place = nullptr,
                                                   .pyramid = first_,
                                                   .points = {}});
    OrbExtractor orb{{}};
    const cv::Mat& image = first_->image();
    for (const OrbFeature& feature : choose_new(orb.extract(image), {}, image.size(), {})) {
      const PointId id = map_.add_point({.p_odom = floor_.point_at(pose(0), feature.pixel),
                                         .descriptor = feature.descriptor,
                                         .observations = {}});
      map_.observe(id, {.keyframe = keyframe, .pixel = feature.pixel});
      points_.push_back(id);
      corners_.push_back(feature.pixel);
    }
  }
  /// How much of the true motion of the points' images over some frames is measured, 1 if all.
  [[nodiscard]] double measured_share(bool refined) const {
    constexpr int kFrames = 6;
    const PatchRefiner refiner{camera_};
    std::vector<std::optional<Vector2d>> at{corners_.begin(), corners_.end()};
    auto previous = first_;
    for (int i = 1; i <= kFrames; ++i) {
      const auto current = pyramid(i);
      std::vector<FlowSeed> seeds;
      seeds.reserve(at.size());
      for (const auto& k : at) {
        seeds.push_back({k.value_or(Vector2d{0, 0}), std::nullopt});
      }
      const auto tracks = DualStreamFlow{{}, camera_}.track(*previous, *current, seeds);
      for (std::size_t k = 0; k < at.size(); ++k) {
        at[k] = at[k] ? tracks[k] : std::nullopt;
        if (refined && at[k]) {
          const PatchSearch search =
              refiner.refine(map_, *map_.find_point(points_[k]), pose(i), *current, *at[k]);
          at[k] = search.found() ? std::optional{search.pixel} : std::nullopt;
        }
      }
      previous = current;
    }
    double along = 0;
    double whole = 0;
    const SE3 T_cam_odom = pose(kFrames).inverse();
    for (std::size_t k = 0; k < at.size(); ++k) {
      if (at[k]) {
        const Vector3d p_cam = T_cam_odom * map_.find_point(points_[k])->p_odom;
        const Vector2d moved = camera_.project(p_cam) - corners_[k];
        along += moved.dot(*at[k] - corners_[k]);
        whole += moved.squaredNorm();
      }
    }
    EXPECT_GT(whole, 20 * 20);
    return along / whole;
  }

  TexturedWall floor_{kHeightM, 5};
  CameraModel camera_{wall_camera()};
  Map map_;
  std::shared_ptr<const ImagePyramid> first_;
  std::vector<PointId> points_;
  std::vector<Vector2d> corners_;
};

TEST_F(PatchRefinerTest, TakesAwayWhatFlowIsShortOfOnAFloor) {
  look(8);
  ASSERT_GT(points_.size(), 50U);
  const double by_flow = measured_share(false);
  const double by_patches = measured_share(true);
  RecordProperty("by_flow", std::to_string(by_flow));
  RecordProperty("by_patches", std::to_string(by_patches));
  EXPECT_LT(by_flow, 0.998);
  EXPECT_NEAR(by_patches, 1, 0.001);
}

TEST_F(PatchRefinerTest, BeyondTheRangeOfDepthTheFloorGoesOn) {
  look(1.2);
  EXPECT_NEAR(measured_share(true), 1, 0.003);
}

TEST_F(PatchRefinerTest, WithoutASurfaceOrAnImageThereIsNothingToAlign) {
  look(8);
  const PatchRefiner refiner{camera_};
  const MapPoint& point = *map_.find_point(points_.front());
  const auto refine = [&] { return refiner.refine(map_, point, pose(0), *first_, corners_[0]); };
  ASSERT_TRUE(refine().found());
  EXPECT_LT((refine().pixel - corners_[0]).norm(), 0.01);
  map_.keyframe(point.observations[0].keyframe).cloud.reset();
  EXPECT_EQ(refine().result, PatchSearch::Result::kUnknown);
  look(8);
  map_.keep_newest(10, 0);
  EXPECT_EQ(
      refiner.refine(map_, *map_.find_point(points_.back()), pose(0), *first_, corners_.back())
          .result,
      PatchSearch::Result::kUnknown);
}

}  // namespace
}  // namespace geoflow::slam
