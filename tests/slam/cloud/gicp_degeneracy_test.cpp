#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

#include "cloud/gicp.hpp"
#include "synthetic_scene.hpp"
#include "views.hpp"

/// Scenes that leave directions of motion open: they must be named, kept at the guess and given no
/// information.
namespace geoflow::slam {
namespace {

using namespace geoflow::tests;

/// Information along one direction (rotation, translation) of the source frame, against that of the
/// best direction.
double relative_information(const RegistrationResult& result, const Vector3d& rotation,
                            const Vector3d& translation) {
  Vector6d direction;
  direction << rotation / result.scale_m, translation;
  return direction.dot(result.information * direction) / result.eigenvalues[5];
}

TEST(GicpDegeneracy, AWallLeavesSlidingAndTurningInItOpen) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const SE3 T = motion({0.004, -0.006, 0.01}, {0.02, -0.01, 0.015});
    const RegistrationResult result =
        register_clouds(view(wall(), T, 2 * seed), view(wall(), SE3{}, 2 * seed + 1), SE3{}, {});
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 3) << result.eigenvalues.transpose();
    // In the wall's own frame, 2 m ahead: x, y and the turn about z.
    EXPECT_LT(relative_information(result, {0, 0, 0}, {1, 0, 0}), 1e-3);
    EXPECT_LT(relative_information(result, {0, 0, 0}, {0, 1, 0}), 1e-3);
    EXPECT_LT(relative_information(result, {0, 0, 1}, {0, 0, 0}), 1e-3);
    EXPECT_GT(relative_information(result, {0, 0, 0}, {0, 0, 1}), 1e-2);
    // The observed ones are found: the wall's plane maps onto itself.
    EXPECT_NEAR((result.T_target_source * Vector3d{T.inverse() * Vector3d{0, 0, 2}}).z(), 2.0,
                1e-3);
    // The open ones stay at the guess but for what the observed ones carry along.
    EXPECT_LT(std::abs(so3::log(result.T_target_source.rotation()).z()), 1e-3);
  }
}

TEST(GicpDegeneracy, ACorridorNeitherHoldsNorPullsAlongItsLength) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const SE3 T = motion({0.002, -0.003, 0.004}, {0.01, -0.01, 0.03});
    const DepthInformation told = constrained(
        linearise(view(corridor(), T, 2 * seed), view(corridor(), SE3{}, 2 * seed + 1), SE3{}, {}),
        {});
    // The corridor's length in the source's frame, as a translation.
    Vector6d along = Vector6d::Zero();
    along.tail<3>() = T.rotation().inverse() * Vector3d{0, 0, 1};
    const double best = told.H.bottomRightCorner<3, 3>().diagonal().maxCoeff();
    EXPECT_LT(along.dot(told.H * along), 1e-3 * best);
    // A step by it and a weak prior moves across, not along.
    const Matrix6d H = told.H + 1e-4 * best * Matrix6d::Identity();
    const Vector6d step = -H.ldlt().solve(told.b);
    EXPECT_NEAR(step[3], T.translation().x(), 3e-3);
    EXPECT_NEAR(step[4], T.translation().y(), 3e-3);
    EXPECT_LT(std::abs(step[5]), 3e-3);
  }
}

TEST(GicpDegeneracy, ACorridorLeavesItsLengthOpen) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const SE3 T = motion({0.004, -0.006, 0.01}, {0.02, -0.01, 0.03});
    const RegistrationResult result = register_clouds(
        view(corridor(), T, 2 * seed), view(corridor(), SE3{}, 2 * seed + 1), SE3{}, {});
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.degenerate_directions, 1) << result.eigenvalues.transpose();
    EXPECT_LT(relative_information(result, {0, 0, 0}, T.rotation().inverse() * Vector3d{0, 0, 1}),
              1e-3);
    EXPECT_LT(std::abs(result.T_target_source.translation().z()), 5e-3) << "kept at the guess";
    EXPECT_NEAR(result.T_target_source.translation().x(), T.translation().x(), 2e-3);
    EXPECT_NEAR(result.T_target_source.translation().y(), T.translation().y(), 2e-3);
    EXPECT_LT(angle_between(result.T_target_source, T), 1e-3);
  }
}

TEST(GicpDegeneracy, ACornerOrABoxLeavesNothingOpen) {
  const SE3 T = motion({0.004, -0.006, 0.01}, {0.02, -0.01, 0.03});
  for (const Scene& scene : {room_corner(), room()}) {
    const RegistrationResult result =
        register_clouds(view(scene, T, 1), view(scene, SE3{}, 2), SE3{}, {});
    EXPECT_EQ(result.degenerate_directions, 0) << result.eigenvalues.transpose();
    EXPECT_LT(distance_between(result.T_target_source, T), 3e-3);
  }
}

TEST(GicpDegeneracy, CovarianceIsNotOptimistic) {
  double nees = 0;
  constexpr int kRuns = 12;
  const SE3 T = motion({0.004, -0.006, 0.01}, {0.02, -0.01, 0.03});
  for (std::uint64_t run = 0; run < kRuns; ++run) {
    const RegistrationResult result =
        register_clouds(view(room(), T, 2 * run + 1), view(room(), SE3{}, 2 * run + 2), SE3{}, {});
    const Vector6d error = (result.T_target_source.inverse() * T).log();
    nees += error.dot(result.information * error) / kRuns;
  }
  EXPECT_LT(nees, 6.0);
}

}  // namespace
}  // namespace geoflow::slam
