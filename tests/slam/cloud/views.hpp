#pragma once

#include <cstdint>

#include <gtest/gtest.h>

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "synthetic_scene.hpp"

/// Clouds of synthetic scenes, for the tests of registration.
namespace geoflow::tests {

inline constexpr double kUnitM = 2e-4;
inline constexpr DepthNoise kKinectNoise{.inverse_depth_sigma = 1e-3, .blur_px = 3};

/// The cloud that a camera at T_world_cam makes of a scene.
inline slam::DepthCloud view(const Scene& scene, const SE3& T_world_cam, std::uint64_t seed = 1,
                             DepthNoise noise = kKinectNoise) {
  const slam::DepthCloudConfig config;
  noise.seed = seed;
  slam::DepthCloud cloud{
      slam::CellGrid::create(vga_camera(), config.cell_px).value(), {.unit_m = kUnitM}, config};
  EXPECT_TRUE(cloud.build(render(scene, T_world_cam, vga_camera(), kUnitM, noise)));
  return cloud;
}

/// exp of a rotation [rad] and translation [m].
inline SE3 motion(const Vector3d& rotation, const Vector3d& translation) {
  Vector6d xi;
  xi << rotation, translation;
  return SE3::exp(xi);
}

inline double angle_between(const SE3& a, const SE3& b) {
  return so3::log(a.rotation().conjugate() * b.rotation()).norm();
}

inline double distance_between(const SE3& a, const SE3& b) {
  return (a.inverse() * b).translation().norm();
}

}  // namespace geoflow::tests
