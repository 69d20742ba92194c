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
DepthCloud floor(std::uint64_t seed, double inverse_depth_sigma, const DepthCloudConfig& config) {
  constexpr double kUnitM = 0.001;
  const Scene scene = {{.normal = {0, 1, 0}, .offset = 0.38}};
  const CameraIntrinsics camera = vga_camera();
  // Matching windows of 9 x 9 px; of a cell as much as a D435 has.
  const DepthNoise noise{.inverse_depth_sigma = inverse_depth_sigma, .blur_px = 9, .seed = seed};
  DepthCloud cloud{
      CellGrid::create(camera, DepthCloudConfig{}.cell_px).value(), {.unit_m = kUnitM}, config};
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

/// Pitch of many steps from the truth [rad].
struct Pitch {
  double mean_rad = 0;
  double error_rad = 0;  ///< of the mean
};

/// Registrations of noisy views of a floor, each this much farther on than the one before.
Pitch pitch_of_steps(double forward_m, double inverse_depth_sigma, const DepthCloudConfig& config) {
  constexpr int kPairs = 40;
  const SE3 T_target_source{Eigen::Quaterniond::Identity(), Vector3d{0, 0, forward_m}};
  double sum = 0;
  double squares = 0;
  DepthCloud target = floor(0, inverse_depth_sigma, config);
  for (int i = 1; i <= kPairs; ++i) {
    DepthCloud source = floor(static_cast<std::uint64_t>(i), inverse_depth_sigma, config);
    const double pitch_rad = pitch_step(linearise(source, target, T_target_source, {}));
    sum += pitch_rad;
    squares += pitch_rad * pitch_rad;
    target = std::move(source);
  }
  const double mean = sum / kPairs;
  return {.mean_rad = mean, .error_rad = std::sqrt((squares / kPairs - mean * mean) / kPairs)};
}

// A surfel's own noise is in its residual and in its lever arm; where the two are multiplied, a
// floor seems to pitch a little in every registration.
TEST(GicpNoise, DoesNotTurnAFloor) {
  const Pitch pitch = pitch_of_steps(0, 0.07, {.max_incidence_deg = 88});
  RecordProperty("mean_mrad", std::to_string(1e3 * pitch.mean_rad));
  RecordProperty("error_mrad", std::to_string(1e3 * pitch.error_rad));
  EXPECT_LT(std::abs(pitch.mean_rad), 3 * pitch.error_rad);
  EXPECT_LT(pitch.error_rad, 0.3e-3) << "too uncertain to tell";
}

// Cells at the limit of incidence pass it by errors that turn them to the camera and lift them.
// With a limit of 78 degrees keyframes that are so far apart share little but such cells, and a
// floor pitches by 4 mrad from each to the next.
TEST(GicpNoise, DoesNotTurnAFloorThatIsWalkedOver) {
  constexpr double kBetweenKeyframesM = 0.65;
  constexpr double kOfD435 = 0.03;
  const Pitch pitch = pitch_of_steps(kBetweenKeyframesM, kOfD435, {});
  RecordProperty("mean_mrad", std::to_string(1e3 * pitch.mean_rad));
  RecordProperty("error_mrad", std::to_string(1e3 * pitch.error_rad));
  EXPECT_LT(std::abs(pitch.mean_rad), 1e-3);
  EXPECT_LT(pitch.error_rad, 0.35e-3) << "too uncertain to tell";
}

}  // namespace
}  // namespace geoflow::slam
