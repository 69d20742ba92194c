#include "cloud/depth_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "synthetic_scene.hpp"

namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

constexpr double kUnitM = 2e-4;

DepthCloud cloud_of(const FrameRef& depth, const CameraIntrinsics& camera = vga_camera(),
                    DepthCloudConfig config = {}) {
  DepthCloud cloud{CellGrid::create(camera, config.cell_px).value(), kUnitM, config};
  EXPECT_TRUE(cloud.build(depth));
  return cloud;
}

/// Largest distance of a surfel from the nearest of the scene's planes and largest angle to its
/// normal.
void expect_on_scene(const DepthCloud& cloud, const Scene& scene, double distance_m,
                     double angle_rad) {
  for (const std::uint32_t cell : cloud.valid()) {
    const Surfel& surfel = cloud.surfels()[cell];
    const auto off = [&](const Face& face) {
      return std::abs(face.normal.dot(surfel.point.cast<double>()) - face.offset);
    };
    const auto face = std::min_element(
        scene.begin(), scene.end(), [&](const Face& a, const Face& b) { return off(a) < off(b); });
    EXPECT_LT(off(*face), distance_m) << "cell " << cell;
    const double cosine = std::abs(face->normal.dot(surfel.normal.cast<double>()));
    EXPECT_GT(cosine, std::cos(angle_rad)) << "cell " << cell;
    EXPECT_LT(surfel.normal.dot(surfel.point), 0) << "towards the camera, cell " << cell;
  }
}

TEST(DepthCloud, SurfelsLieOnAPlainWall) {
  const DepthCloud cloud = cloud_of(render(wall(), SE3{}, vga_camera(), kUnitM));
  EXPECT_EQ(cloud.size(), cloud.grid().size());
  expect_on_scene(cloud, wall(), 1e-4, 0.01);
}

TEST(DepthCloud, UndoesTheLensDistortion) {
  CameraIntrinsics camera = vga_camera();
  camera.model = DistortionModel::kRadtan;
  camera.distortion = {0.12, -0.2, 0.001, -0.002, 0.05};
  const DepthCloud cloud = cloud_of(render(room_corner(), SE3{}, camera, kUnitM), camera);
  EXPECT_GT(cloud.size(), cloud.grid().size() / 2);
  for (const std::uint32_t cell : cloud.valid()) {
    const auto back = cloud.grid().project(cloud.surfels()[cell].point);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->y() * cloud.grid().columns() + back->x(), static_cast<int>(cell));
  }
}

TEST(DepthCloud, RejectsCellsAcrossAnEdge) {
  const DepthCloud cloud = cloud_of(render(wall_with_box(), SE3{}, vga_camera(), kUnitM));
  expect_on_scene(cloud, wall_with_box(), 2e-3, 0.05);
}

TEST(DepthCloud, StatedVarianceIsThatOfTheNoise) {
  DepthCloudConfig config;
  config.correlated_pixels = 1.0;
  double normalised = 0;
  std::size_t count = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const DepthCloud cloud = cloud_of(
        render(wall(), SE3{}, vga_camera(), kUnitM, {.inverse_depth_sigma = 1.5e-3, .seed = seed}),
        vga_camera(), config);
    for (const std::uint32_t cell : cloud.valid()) {
      const Surfel& surfel = cloud.surfels()[cell];
      const Vector3d point = surfel.point.cast<double>();
      const double error = surfel.normal.cast<double>().dot(point - 2.0 / point.z() * point);
      normalised += error * error / static_cast<double>(surfel.normal_variance);
      ++count;
    }
  }
  EXPECT_GT(count, 10000U);
  EXPECT_NEAR(normalised / static_cast<double>(count), 1.0, 0.15);
}

TEST(DepthCloud, HolesAndEmptyImages) {
  const DepthCloud holes =
      cloud_of(render(wall(), SE3{}, vga_camera(), kUnitM, {.hole_probability = 0.3}));
  EXPECT_GT(holes.size(), holes.grid().size() * 3 / 4);
  expect_on_scene(holes, wall(), 1e-4, 0.02);
  EXPECT_EQ(cloud_of(render({}, SE3{}, vga_camera(), kUnitM)).size(), 0U);
}

TEST(DepthCloud, RefusesWhatIsNotItsCamerasDepth) {
  DepthCloud cloud{CellGrid::create(vga_camera(), 8).value(), kUnitM, {}};
  EXPECT_EQ(cloud.build(FrameRef{}).error().code, ErrorCode::kInvalidArgument);
  FramePool pool{1};
  EXPECT_EQ(cloud.build(pool.acquire({640, 480, PixelFormat::kGray8})).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(cloud.build(pool.acquire({320, 240, PixelFormat::kDepth16})).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(CellGrid, RefusesImpossibleCameras) {
  CameraIntrinsics camera = vga_camera();
  EXPECT_FALSE(CellGrid::create(camera, 0));
  EXPECT_FALSE(CellGrid::create(camera, 1000));
  camera.fx = 0;
  EXPECT_FALSE(CellGrid::create(camera, 8));
  camera = vga_camera();
  camera.height = 0;
  EXPECT_FALSE(CellGrid::create(camera, 8));
  camera = vga_camera();
  camera.cx = std::nan("");
  EXPECT_FALSE(CellGrid::create(camera, 8));
}

}  // namespace
}  // namespace geoflow::slam
