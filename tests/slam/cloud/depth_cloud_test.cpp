#include "cloud/depth_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/pixel_depth.hpp"
#include "synthetic_scene.hpp"

namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

constexpr double kUnitM = 2e-4;

DepthCloud cloud_of(const FrameRef& depth, const CameraIntrinsics& camera = vga_camera(),
                    DepthCloudConfig config = {}) {
  DepthCloud cloud{CellGrid::create(camera, config.cell_px).value(), {.unit_m = kUnitM}, config};
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
    const auto face = std::ranges::min_element(
        scene, [&](const Face& a, const Face& b) { return off(a) < off(b); });
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

/// Mean squared error of surfels on the wall, over their stated variance, and the number of
/// surfels.
std::pair<double, double> normalised_error(const DepthNoise& noise) {
  double normalised = 0;
  double count = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    DepthNoise seeded = noise;
    seeded.seed = seed;
    const DepthCloud cloud = cloud_of(render(wall(), SE3{}, vga_camera(), kUnitM, seeded));
    for (const std::uint32_t cell : cloud.valid()) {
      const Surfel& surfel = cloud.surfels()[cell];
      const Vector3d point = surfel.point.cast<double>();
      const double error = surfel.normal.cast<double>().dot(point - 2.0 / point.z() * point);
      normalised += error * error / static_cast<double>(surfel.normal_variance);
      ++count;
    }
  }
  return {normalised / count, count};
}

TEST(DepthCloud, StatedVarianceIsThatOfTheNoiseWhetherItsPixelsErrAloneOrTogether) {
  for (const int blur_px : {1, 3, 5}) {
    const auto [error, count] = normalised_error({.inverse_depth_sigma = 4e-3, .blur_px = blur_px});
    EXPECT_GT(count, 10000) << blur_px;
    EXPECT_NEAR(error, 1.0, 0.25) << blur_px;
  }
}

/// What librealsense's align makes of a depth camera's image on a colour camera at the same place:
/// each pixel has the nearest of the depth pixels whose outline touches it.
FrameRef aligned(const FrameRef& depth, const CameraIntrinsics& from, const CameraIntrinsics& to) {
  const auto width = static_cast<std::size_t>(to.width);
  std::vector<std::uint16_t> pixels(width * static_cast<std::size_t>(to.height));
  const auto along = [](double x, double f, double c, double f_to, double c_to) {
    return static_cast<int>(std::floor((x - c) / f * f_to + c_to + 0.5));
  };
  for (int v = 0; v < from.height; ++v) {
    for (int u = 0; u < from.width; ++u) {
      const std::uint16_t z = depth.row<std::uint16_t>(v)[u];
      const int left = std::max(0, along(u - 0.5, from.fx, from.cx, to.fx, to.cx));
      const int right = std::min(to.width - 1, along(u + 0.5, from.fx, from.cx, to.fx, to.cx));
      const int top = std::max(0, along(v - 0.5, from.fy, from.cy, to.fy, to.cy));
      const int bottom = std::min(to.height - 1, along(v + 0.5, from.fy, from.cy, to.fy, to.cy));
      for (int y = top; y <= bottom; ++y) {
        for (int x = left; x <= right; ++x) {
          std::uint16_t& pixel =
              pixels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)];
          pixel = pixel == 0 ? z : std::min(pixel, z);
        }
      }
    }
  }
  FrameRef image = FramePool{1}.acquire({to.width, to.height, PixelFormat::kDepth16});
  std::ranges::copy(std::as_bytes(std::span{pixels}), image.writable_bytes().begin());
  return image;
}

/// The pixel at an offset from the corner of a cell of 8 x 8.
Vector2d pixel_of(const DepthCloud& cloud, std::uint32_t cell, const Vector2d& offset) {
  const auto columns = static_cast<std::uint32_t>(cloud.grid().columns());
  const std::uint32_t column = cell % columns;
  const std::uint32_t row = cell / columns;
  return 8.0 * Vector2d{column, row} + offset;
}

/// Mean distance [m] of a corridor's surfels towards the camera from the planes they lie on.
double mean_nearness(DepthAlignment alignment, const DepthNoise& noise) {
  CameraIntrinsics depth_camera = vga_camera();
  depth_camera.fx = depth_camera.fy = 384;
  DepthCloud cloud{
      CellGrid::create(vga_camera(), 8).value(), {.unit_m = kUnitM, .alignment = alignment}, {}};
  EXPECT_TRUE(cloud.build(
      aligned(render(corridor(), SE3{}, depth_camera, kUnitM, noise), depth_camera, vga_camera())));
  double sum = 0;
  double count = 0;
  for (const std::uint32_t cell : cloud.valid()) {
    const Vector3d p = cloud.surfels()[cell].point.cast<double>();
    double nearest = 1;
    for (const Face& face : corridor()) {
      const double off = std::abs(face.offset) - std::copysign(1, face.offset) * face.normal.dot(p);
      nearest = std::abs(off) < std::abs(nearest) ? off : nearest;
    }
    sum += nearest;
    ++count;
  }
  EXPECT_GT(count, 1500);
  return sum / count;
}

TEST(DepthCloud, UndoesTheNearnessOfAlignedDepth) {
  const DepthNoise none;
  const DepthNoise noise{.inverse_depth_sigma = 3e-3, .blur_px = 5};
  // Of a floor and walls at 1 m, seen under angles down to 12 degrees.
  const double exact = mean_nearness(DepthAlignment::kExact, none);
  EXPECT_GT(exact, 8e-4);
  EXPECT_LT(std::abs(mean_nearness(DepthAlignment::kNearestTouching, none)), 0.1 * exact);
  const double uncorrected = mean_nearness(DepthAlignment::kExact, noise);
  EXPECT_GT(uncorrected, 1e-3);
  EXPECT_LT(std::abs(mean_nearness(DepthAlignment::kNearestTouching, noise)), 0.35 * uncorrected);
}

TEST(PixelDepth, IsThatOfTheSurfaceAndNoneOnItsEdge) {
  const FrameRef image = render(wall_with_box(), SE3{}, vga_camera(), kUnitM,
                                {.inverse_depth_sigma = 2e-3, .blur_px = 1});
  const DepthCloud cloud = cloud_of(image);
  double squares = 0;
  double count = 0;
  for (const std::uint32_t cell : cloud.valid()) {
    const double z = depth_at(cloud, image, pixel_of(cloud, cell, {3, 4}));
    const bool on_wall = z > 2.3;
    squares += z > 0 && on_wall ? std::pow(z - 2.5, 2) : 0;
    count += z > 0 && on_wall ? 1 : 0;
  }
  EXPECT_GT(count, 1000);
  // 64 pixels of 12.5 mm each, not one.
  EXPECT_LT(std::sqrt(squares / count), 0.005);
  std::size_t edges = 0;
  for (std::uint32_t cell = 0; cell < cloud.grid().size(); ++cell) {
    if (!cloud.surfels()[cell].valid()) {
      ++edges;
      EXPECT_EQ(depth_at(cloud, image, pixel_of(cloud, cell, {3, 4})), 0);
    }
  }
  EXPECT_GT(edges, 50U);
}

TEST(PixelDepth, OfASteepViewCountsOnlyWhereParallaxAgrees) {
  // A floor 0.4 m below the camera, of which everything beyond 1.9 m is seen too steeply for a
  // surfel: what shows there may be mirrored.
  const Scene floor{{.normal = Vector3d::UnitY(), .offset = 0.4}};
  const FrameRef image =
      render(floor, SE3{}, vga_camera(), kUnitM, {.inverse_depth_sigma = 1e-3, .blur_px = 3});
  const DepthCloud cloud = cloud_of(image);
  const Eigen::Vector2d raw{300, vga_camera().cy + vga_camera().fy * 0.4 / 2.5};
  EXPECT_EQ(depth_at(cloud, image, raw), 0);
  EXPECT_NEAR(depth_at(cloud, image, raw, 2.4), 2.5, 0.05);
  EXPECT_EQ(depth_at(cloud, image, raw, 4.0), 0) << "what the floor mirrors";
  const Eigen::Vector2d near{300, vga_camera().cy + vga_camera().fy * 0.4 / 1.2};
  EXPECT_NEAR(depth_at(cloud, image, near), 1.2, 0.02);
}

TEST(DepthCloud, HolesAndEmptyImages) {
  const DepthCloud holes =
      cloud_of(render(wall(), SE3{}, vga_camera(), kUnitM, {.hole_probability = 0.3}));
  EXPECT_GT(holes.size(), holes.grid().size() * 3 / 4);
  expect_on_scene(holes, wall(), 1e-4, 0.02);
  EXPECT_EQ(cloud_of(render({}, SE3{}, vga_camera(), kUnitM)).size(), 0U);
}

TEST(DepthCloud, RefusesWhatIsNotItsCamerasDepth) {
  DepthCloud cloud{CellGrid::create(vga_camera(), 8).value(), {.unit_m = kUnitM}, {}};
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
