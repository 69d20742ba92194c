#include "odometry/depth_scale.hpp"

#include <cmath>
#include <memory>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "synthetic_scene.hpp"

namespace geoflow::slam {
namespace {

constexpr double kWallM = 2;  ///< of tests::wall()

class DepthScaleTest : public testing::Test {
 protected:
  DepthScaleTest() {
    constexpr double kUnitM = 1e-3;
    const auto camera = tests::vga_camera();
    auto grid = CellGrid::create(camera, DepthCloudConfig{}.cell_px).value();
    auto cloud = std::make_shared<DepthCloud>(grid, DepthCloud::Pixels{kUnitM}, DepthCloudConfig{});
    EXPECT_TRUE(cloud->build(tests::render(tests::wall(), SE3{}, camera, kUnitM)));
    wall_ = cloud;
  }
  void walk(const Vector3d& from, const Vector3d& to) {
    constexpr int kSteps = 50;
    for (int i = 0; i <= kSteps; ++i) {
      scale_.follow(from + (to - from) * i / kSteps, wall_.get());
    }
  }

  std::shared_ptr<const DepthCloud> wall_;
  DepthScale scale_;
};

TEST_F(DepthScaleTest, MakesTheWayUncertainByAsMuchAsWhatIsSeenIsFar) {
  walk(Vector3d::Zero(), {10, 0, 0});
  EXPECT_NEAR(std::sqrt(scale_.covariance()(0, 0)), DepthScale::kSigma * kWallM * 10, 1e-3);
  EXPECT_NEAR(scale_.covariance()(1, 1), 0, 1e-12);
}

TEST_F(DepthScaleTest, IsTakenBackOnTheWayBack) {
  walk(Vector3d::Zero(), {10, 4, 0});
  walk({10, 4, 0}, Vector3d::Zero());
  EXPECT_NEAR(scale_.covariance().norm(), 0, 1e-12);
}

TEST_F(DepthScaleTest, TurnsWithTheMapAndNoStepIsMadeByThat) {
  walk(Vector3d::Zero(), {10, 0, 0});
  const SE3 T_odom1_odom0{
      Eigen::Quaterniond{Eigen::AngleAxisd{std::numbers::pi / 2, Vector3d::UnitZ()}},
      Vector3d{3, 0, 0}};
  scale_.move(T_odom1_odom0);
  scale_.follow(T_odom1_odom0 * Vector3d{10, 0, 0}, nullptr);
  EXPECT_NEAR(scale_.covariance()(0, 0), 0, 1e-12);
  EXPECT_NEAR(std::sqrt(scale_.covariance()(1, 1)), DepthScale::kSigma * kWallM * 10, 1e-3);
}

}  // namespace
}  // namespace geoflow::slam
