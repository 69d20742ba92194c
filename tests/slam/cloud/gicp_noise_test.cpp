#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "synthetic_scene.hpp"

/// What noise does to registration when nothing has moved: it must not add up.
namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

/// A floor as a robot dog's camera has it before it, seen level from 0.38 m.
DepthCloud floor(std::uint64_t seed) {
  constexpr double kUnitM = 0.001;
  const Scene scene = {{.normal = {0, 1, 0}, .offset = 0.38}};
  const CameraIntrinsics camera = vga_camera();
  // Matching windows of 9 x 9 px; of a cell as much as a D435 has.
  const DepthNoise noise{.inverse_depth_sigma = 0.07, .blur_px = 9, .seed = seed};
  DepthCloud cloud{CellGrid::create(camera, DepthCloudConfig{}.cell_px).value(),
                   {.unit_m = kUnitM},
                   {.max_incidence_deg = 88}};
  EXPECT_TRUE(cloud.build(render(scene, SE3{}, camera, kUnitM, noise)));
  return cloud;
}

/// The Gauss-Newton step in the directions that a floor constrains: pitch [rad].
double pitch_step(const NormalEquations& system) {
  constexpr int kPitch = 0;
  constexpr int kRoll = 2;
  constexpr int kHeight = 4;
  const Eigen::Array3i constrained{kPitch, kRoll, kHeight};
  const Matrix3d H = system.H(constrained, constrained);
  const Vector3d b = system.b(constrained);
  return -H.ldlt().solve(b).x();
}

// A surfel's own noise is in its residual and in its lever arm; where the two are multiplied, a
// floor seems to pitch a little in every registration.
TEST(GicpNoise, DoesNotTurnAFloor) {
  constexpr int kPairs = 40;
  double sum = 0;
  double squares = 0;
  DepthCloud target = floor(0);
  for (int i = 1; i <= kPairs; ++i) {
    DepthCloud source = floor(static_cast<std::uint64_t>(i));
    const double pitch_rad = pitch_step(linearise(source, target, SE3{}, {}));
    sum += pitch_rad;
    squares += pitch_rad * pitch_rad;
    target = std::move(source);
  }
  const double mean = sum / kPairs;
  const double error = std::sqrt((squares / kPairs - mean * mean) / kPairs);
  RecordProperty("mean_mrad", std::to_string(1e3 * mean));
  RecordProperty("error_mrad", std::to_string(1e3 * error));
  EXPECT_LT(std::abs(mean), 3 * error);
  EXPECT_LT(error, 0.3e-3) << "too uncertain to tell";
}

}  // namespace
}  // namespace geoflow::slam
