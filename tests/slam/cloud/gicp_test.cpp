#include "cloud/gicp.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "synthetic_scene.hpp"

namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

constexpr double kUnitM = 2e-4;
constexpr DepthNoise kKinectNoise{.inverse_depth_sigma = 1e-3, .blur_px = 3};

DepthCloud view(const Scene& scene, const SE3& T_world_cam, DepthNoise noise = kKinectNoise,
                std::uint64_t seed = 1) {
  const DepthCloudConfig config;
  noise.seed = seed;
  DepthCloud cloud{CellGrid::create(vga_camera(), config.cell_px).value(), kUnitM, config};
  EXPECT_TRUE(cloud.build(render(scene, T_world_cam, vga_camera(), kUnitM, noise)));
  return cloud;
}

SE3 motion(double rx, double ry, double rz, double x, double y, double z) {
  Vector6d xi;
  xi << rx, ry, rz, x, y, z;
  return SE3::exp(xi);
}

double angle_between(const SE3& a, const SE3& b) {
  return so3::log(a.rotation().conjugate() * b.rotation()).norm();
}
double distance_between(const SE3& a, const SE3& b) {
  return (a.inverse() * b).translation().norm();
}

TEST(Gicp, FindsKnownMotionsFromIdentity) {
  const DepthCloud target = view(room(), SE3{}, kKinectNoise, 1);
  std::uint64_t seed = 2;
  for (const SE3& T : {motion(0.01, -0.02, 0.005, 0.01, -0.005, 0.02),
                       motion(-0.03, 0.02, 0.03, -0.03, 0.02, 0.04),
                       motion(0.02, 0.07, -0.02, 0.05, -0.02, -0.05)}) {
    const RegistrationResult result =
        register_clouds(view(room(), T, kKinectNoise, seed++), target, SE3{}, {});
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 0);
    EXPECT_LT(distance_between(result.T_target_source, T), 3e-3);
    EXPECT_LT(angle_between(result.T_target_source, T), 1.5e-3);
  }
}

TEST(Gicp, SameBitsWithOneAndTwoThreads) {
  const DepthCloud target = view(room(), SE3{}, kKinectNoise, 1);
  const DepthCloud source =
      view(room(), motion(0.01, 0.02, -0.01, 0.02, 0.01, 0.01), kKinectNoise, 2);
  std::vector<RegistrationResult> results;
  for (const std::size_t threads : {1U, 2U, 2U}) {
    const tbb::global_control limit{tbb::global_control::max_allowed_parallelism, threads};
    results.push_back(register_clouds(source, target, SE3{}, {}));
  }
  for (const RegistrationResult& result : results) {
    EXPECT_EQ(result.T_target_source.matrix(), results[0].T_target_source.matrix());
    EXPECT_EQ(result.information, results[0].information);
    EXPECT_EQ(result.rmse_m, results[0].rmse_m);
  }
}

TEST(Gicp, NothingToAlignIsNotConverged) {
  const DepthCloud empty = view({}, SE3{});
  const DepthCloud full = view(room(), SE3{});
  const SE3 guess = motion(0.1, 0, 0, 0, 0.2, 0);
  for (const RegistrationResult& result :
       {register_clouds(empty, full, guess, {}), register_clouds(full, empty, guess, {}),
        register_clouds(empty, empty, guess, {}),
        register_clouds(full, full, motion(0, 3.0, 0, 0, 0, 0), {})}) {
    EXPECT_FALSE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 6);
    EXPECT_EQ(result.information, Matrix6d::Zero());
  }
  EXPECT_EQ(register_clouds(empty, full, guess, {}).T_target_source.matrix(), guess.matrix());
}

}  // namespace
}  // namespace geoflow::slam
