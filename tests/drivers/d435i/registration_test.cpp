#include "d435i/pixels/registration.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

/// A plane in the colour camera's frame: n . p = d.
struct Plane {
  Vector3d n;
  double d = 0;
};

constexpr CameraIntrinsics kDepth{
    .width = 640, .height = 480, .fx = 382.9, .fy = 382.9, .cx = 319.9, .cy = 236.1};
constexpr CameraIntrinsics kColor{
    .width = 640, .height = 480, .fx = 612.4, .fy = 610.6, .cx = 314.3, .cy = 237.8};

SE3 color_to_depth() {
  const Vector3d turn{0.001, -0.0008, 0.0094};
  const Vector3d p_depth_cam{-0.01501, 0.00136, -0.00025};
  return {so3::exp(turn), p_depth_cam};
}

Vector3d ray(const CameraIntrinsics& camera, int u, int v) {
  return {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1};
}

/// The farthest that depth of 0.1 mm counts can say is 6.5535 m.
constexpr double kFarthest_m = 6.5;

/// Depth [counts of 0.1 mm] of the nearest of some planes, as the depth camera sees it.
std::vector<std::uint16_t> render(const std::vector<Plane>& planes) {
  const SE3 T_cam_depth = color_to_depth().inverse();
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < kDepth.height; ++v) {
    for (int u = 0; u < kDepth.width; ++u) {
      double nearest = 0;
      for (const Plane& plane : planes) {
        const Vector3d direction = T_cam_depth.rotation() * ray(kDepth, u, v);
        const double z =
            (plane.d - plane.n.dot(T_cam_depth.translation())) / plane.n.dot(direction);
        nearest = z > 0 && z < kFarthest_m && (nearest == 0 || z < nearest) ? z : nearest;
      }
      depth.push_back(static_cast<std::uint16_t>(std::lround(nearest * 1e4)));
    }
  }
  return depth;
}

std::vector<std::uint16_t> registered(const std::vector<std::uint16_t>& depth,
                                      const CameraIntrinsics& color = kColor) {
  auto registration = DepthRegistration::create({.depth = kDepth,
                                                 .color = color,
                                                 .T_cam_depth = color_to_depth().inverse(),
                                                 .depth_unit_m = 1e-4});
  EXPECT_TRUE(registration);
  std::vector<std::uint16_t> target(kColor.width * kColor.height, 7);
  EXPECT_TRUE(registration->run(std::as_bytes(std::span{depth}), target));
  return target;
}

std::uint16_t at(const std::vector<std::uint16_t>& image, int u, int v) {
  return image[static_cast<std::size_t>(v * kColor.width + u)];
}

TEST(DepthRegistration, APlaneComesOutExactly) {
  // A wall at 2 m, and floors seen at ever flatter angles.
  for (const Plane& plane : {Plane{{0, 0, 1}, 2}, Plane{{0, 1, 0.5}, 1},
                             Plane{{0.3, 0.6, 0.7}, 1.5}, Plane{{-0.5, 0.1, 1}, 1}}) {
    const auto image = registered(render({plane}));
    double worst = 0;
    for (int v = 2; v < kColor.height - 2; ++v) {
      for (int u = 2; u < kColor.width - 2; ++u) {
        const double z_m = plane.d / plane.n.dot(ray(kColor, u, v));
        if (z_m < 0 || z_m > 0.9 * kFarthest_m) {
          continue;
        }
        const double z = z_m * 1e4;
        ASSERT_GT(at(image, u, v), 0) << u << ", " << v;
        worst = std::max(worst, std::abs(at(image, u, v) - z));
      }
    }
    // Two roundings to whole counts, and float arithmetic.
    EXPECT_LT(worst, 1.5) << "plane with normal " << plane.n.transpose();
  }
}

TEST(DepthRegistration, AnEdgeStaysWhereItIsSeen) {
  // A wall at 3 m, and before it at 1 m a half plane that ends at x = 0.1 m.
  const std::vector<std::uint16_t> wall = render({{{0, 0, 1}, 3}});
  std::vector<std::uint16_t> depth = wall;
  const std::vector<std::uint16_t> near = render({{{0, 0, 1}, 1}});
  const SE3 T_cam_depth = color_to_depth().inverse();
  for (int v = 0; v < kDepth.height; ++v) {
    for (int u = 0; u < kDepth.width; ++u) {
      const auto i = static_cast<std::size_t>(v * kDepth.width + u);
      const Vector3d p_depth = ray(kDepth, u, v) * (near[i] * 1e-4);
      if ((T_cam_depth * p_depth).x() < 0.1) {
        depth[i] = near[i];
      }
    }
  }
  const auto image = registered(depth);
  const double edge_px = 0.1 * kColor.fx + kColor.cx;
  for (int v = 5; v < kColor.height - 5; ++v) {
    for (int u = 5; u < kColor.width - 5; ++u) {
      // Half an outline of a depth pixel is 0.8 colour pixels; what lies in the shadow of the
      // nearer plane for the depth camera has no depth.
      if (u < edge_px - 1.8) {
        ASSERT_NEAR(at(image, u, v), 10'000, 2) << u << ", " << v;
      } else if (u > edge_px + 1.8) {
        const int z = at(image, u, v);
        ASSERT_TRUE(z == 0 || std::abs(z - 30'000) <= 2) << u << ", " << v << ": " << z;
      }
    }
  }
}

TEST(DepthRegistration, NothingIsInventedAcrossAHole) {
  std::vector<std::uint16_t> depth = render({{{0, 0, 1}, 2}});
  for (int v = 140; v < 160; ++v) {
    for (int u = 160; u < 190; ++u) {
      depth[static_cast<std::size_t>(v * kDepth.width + u)] = 0;
    }
  }
  const auto image = registered(depth);
  const auto holes = std::ranges::count(image, std::uint16_t{0});
  // 30 x 20 depth pixels at 1.6 x 1.6 colour pixels each, less and more the border's rounding.
  EXPECT_NEAR(static_cast<double>(holes), 30 * 20 * 612.4 * 610.6 / (382.9 * 382.9), 90);
}

TEST(DepthRegistration, AnEmptyImageStaysEmpty) {
  const auto image = registered(
      std::vector<std::uint16_t>(static_cast<std::size_t>(kDepth.width * kDepth.height)));
  EXPECT_EQ(std::ranges::count(image, std::uint16_t{0}), kColor.width * kColor.height);
}

TEST(DepthRegistration, TheNearerOfTwoSurfacesHidesTheOther) {
  const auto image = registered(render({{{0, 0, 1}, 3}, {{0, 0.9, 0.3}, 0.3}}));
  for (int v = 3; v < kColor.height - 3; ++v) {
    const double floor_m = 0.3 / Vector3d{0, 0.9, 0.3}.dot(ray(kColor, 320, v));
    const double z = floor_m > 0 ? std::min(3.0, floor_m) : 3.0;
    const bool at_the_joint = std::abs(floor_m - 3) < 0.2;
    EXPECT_NEAR(at(image, 320, v), z * 1e4, at_the_joint ? 2000.0 : 3.0) << "row " << v;
  }
}

TEST(DepthRegistration, ADistortedColourCameraIsFollowed) {
  CameraIntrinsics color = kColor;
  color.model = DistortionModel::kRadtan;
  color.distortion = {0.1, -0.05, 0.001, -0.002, 0.01};
  const Plane plane{{0.2, 0.3, 0.9}, 1.5};
  const auto image = registered(render({plane}), color);
  // Of a point on the plane: the pixel that sees it has its depth.
  for (double x = -0.3; x < 0.3; x += 0.05) {
    for (double y = -0.2; y < 0.2; y += 0.05) {
      const double r2 = x * x + y * y;
      const double radial = 1 + r2 * (0.1 + r2 * (-0.05 + r2 * 0.01));
      const double xd = x * radial + 2 * 0.001 * x * y - 0.002 * (r2 + 2 * x * x);
      const double yd = y * radial + 0.001 * (r2 + 2 * y * y) - 2 * 0.002 * x * y;
      const auto u = static_cast<int>(std::lround(color.fx * xd + color.cx));
      const auto v = static_cast<int>(std::lround(color.fy * yd + color.cy));
      const double z = plane.d / plane.n.dot(Vector3d{x, y, 1}) * 1e4;
      // Half a pixel off, the plane's depth changes by at most 0.3 % of a pixel's angle.
      EXPECT_NEAR(at(image, u, v), z, 0.005 * z) << x << ", " << y;
    }
  }
}

TEST(DepthRegistration, RefusesWhatItWasNotMadeFor) {
  CameraIntrinsics bad = kDepth;
  bad.fx = 0;
  EXPECT_FALSE(DepthRegistration::create({.depth = bad, .color = kColor, .T_cam_depth = {}}));
  CameraIntrinsics fisheye = kColor;
  fisheye.model = DistortionModel::kEquidistant;
  EXPECT_FALSE(DepthRegistration::create({.depth = kDepth, .color = fisheye, .T_cam_depth = {}}));
  auto made = DepthRegistration::create({.depth = kDepth, .color = kColor, .T_cam_depth = {}});
  ASSERT_TRUE(made);
  std::vector<std::uint16_t> target(10);
  EXPECT_FALSE(made->run(std::as_bytes(std::span{target}), target));
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
