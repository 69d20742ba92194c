#include "inertial/motion_alignment.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "slam/inertial/motion.hpp"

namespace geoflow::slam {
namespace {

using inertial_tests::normal3;
using std::chrono::milliseconds;

constexpr double kRotationSigma = 3e-3;
constexpr double kTranslationSigma = 5e-3;

/// Poses of a trotting robot in an odom frame that is not level, and an IMU with biases.
struct Scene {
  std::vector<SeenPose> poses;
  std::vector<Preintegrated> between;
  NavState newest;  ///< true, in odom
  Vector3d gravity_odom;
};

Scene make_scene(std::mt19937_64& random, int count, Duration step) {
  const inertial_tests::SineMotion motion{random};
  const HostTime end = HostTime{} + (count - 1) * step;
  const ImuBias bias{0.02 * normal3(random), 0.1 * normal3(random)};
  const auto samples =
      unscreened(inertial_tests::noisy_samples(motion, HostTime{}, end, bias, ImuNoise{}, random));
  const SE3 T_odom1_odom0{so3::exp(normal3(random)), normal3(random)};
  Scene scene;
  for (int i = 0; i < count; ++i) {
    const HostTime t = HostTime{} + i * step;
    const SE3 T_odom0_imu = motion.state(t).T_odom_imu;
    Vector6d error;
    error << kRotationSigma * normal3(random), kTranslationSigma * normal3(random);
    scene.poses.push_back(
        {T_odom1_odom0 * T_odom0_imu * SE3::exp(error), kRotationSigma, kTranslationSigma});
    if (i > 0) {
      scene.between.push_back(*preintegrate(samples, t - step, t, {}, ImuNoise{}));
    }
  }
  const NavState level = motion.state(end);
  const SE3& T_odom0_imu = level.T_odom_imu;
  scene.newest = {T_odom1_odom0 * T_odom0_imu, T_odom1_odom0.rotation() * level.v_odom, bias};
  scene.gravity_odom = T_odom1_odom0.rotation() * gravity_down();
  return scene;
}

BiasPrior prior() {
  BiasPrior prior;
  prior.covariance.diagonal() << Vector3d::Constant(4e-4), Vector3d::Constant(1e-2);
  return prior;
}

TEST(MotionAlignment, ErrorsAreAsLargeAsTheCovarianceSays) {
  std::mt19937_64 random{tests::test_seed(71)};
  double nees = 0;
  double chi_square = 0;
  double gravity = 0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    const Scene scene = make_scene(random, 12, milliseconds{200});
    const auto fix = align_motion(scene.poses, scene.between, prior());
    ASSERT_TRUE(fix.has_value()) << fix.error().message;
    const StateVector error = scene.newest.minus(fix->states.back());
    nees += error.dot(fix->covariance.ldlt().solve(error)) / kStateSize / kRuns;
    chi_square += fix->chi_square_per_dof / kRuns;
    const double angle = std::acos(
        std::min(1.0, fix->gravity_odom.normalized().dot(scene.gravity_odom.normalized())));
    EXPECT_LT(angle, 4 * fix->gravity_sigma_rad);
    gravity = std::max(gravity, angle);
  }
  RecordProperty("nees_per_dof", std::to_string(nees));
  RecordProperty("chi_square_per_dof", std::to_string(chi_square));
  RecordProperty("worst_gravity_rad", std::to_string(gravity));
  EXPECT_GT(nees, 0.85);  // 1500 dimensions: 1 +- 0.037, and first-order bias corrections
  EXPECT_LT(nees, 1.15);
  EXPECT_GT(chi_square, 0.9);
  EXPECT_LT(chi_square, 1.1);
}

TEST(MotionAlignment, RefusesWhatItCannotSee) {
  std::mt19937_64 random{tests::test_seed(72)};
  const Scene scene = make_scene(random, 4, milliseconds{33});
  const auto fix = align_motion(scene.poses, scene.between, prior());
  ASSERT_FALSE(fix.has_value());
  EXPECT_EQ(fix.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(fix.error().message.find("not observable"), std::string::npos) << fix.error().message;
}

TEST(MotionAlignment, RefusesPosesOfAnotherMotion) {
  std::mt19937_64 random{tests::test_seed(73)};
  Scene scene = make_scene(random, 12, milliseconds{200});
  const Scene other = make_scene(random, 12, milliseconds{200});
  scene.between = other.between;
  const auto fix = align_motion(scene.poses, scene.between, prior());
  ASSERT_FALSE(fix.has_value());
  EXPECT_NE(fix.error().message.find("disagree"), std::string::npos) << fix.error().message;
}

TEST(MotionAlignment, RefusesNumbersThatDoNotFit) {
  std::mt19937_64 random{tests::test_seed(74)};
  const Scene scene = make_scene(random, 3, milliseconds{200});
  const std::vector<SeenPose> two{scene.poses.begin(), scene.poses.begin() + 2};
  EXPECT_EQ(align_motion(two, scene.between, prior()).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(align_motion({}, {}, prior()).error().code, ErrorCode::kInvalidArgument);
}

/// Real data: EuRoC in flight, with poses of the ground truth every 0.25 s over 4 s, cold prior.
TEST(MotionAlignment, FindsGravityAndGyroBiasOfEurocInFlight) {
  GEOFLOW_DATA_OR_SKIP(folder, "euroc-v102");
  const auto samples = unscreened(inertial_tests::read_euroc_imu(folder));
  const auto truth = inertial_tests::read_euroc_truth(folder);
  constexpr std::size_t kStep = 50;
  constexpr std::size_t kPoses = 17;
  double worst_tilt = 0;
  double worst_gyro = 0;
  double worst_velocity = 0;
  int windows = 0;
  for (std::size_t begin = 1500; begin + kStep * kPoses < truth.size() - 1000; begin += 1000) {
    std::vector<SeenPose> poses;
    std::vector<Preintegrated> between;
    for (std::size_t i = 0; i < kPoses; ++i) {
      const auto& at = truth[begin + i * kStep];
      poses.push_back({at.state.T_odom_imu, kRotationSigma, kTranslationSigma});
      if (i > 0) {
        const auto measured = preintegrate(samples, truth[begin + (i - 1) * kStep].t, at.t, {},
                                           inertial_tests::euroc_noise());
        ASSERT_TRUE(measured.has_value());
        between.push_back(*measured);
      }
    }
    const auto fix = align_motion(poses, between, BiasPrior::cold());
    ASSERT_TRUE(fix.has_value()) << fix.error().message;
    const NavState& newest = truth[begin + (kPoses - 1) * kStep].state;
    ++windows;
    worst_tilt =
        std::max(worst_tilt, std::acos(std::min(1.0, -fix->gravity_odom.normalized().z())));
    worst_gyro =
        std::max(worst_gyro, (fix->states.back().bias.gyro_radps - newest.bias.gyro_radps).norm());
    worst_velocity = std::max(worst_velocity, (fix->states.back().v_odom - newest.v_odom).norm());
  }
  ASSERT_GT(windows, 5);
  RecordProperty("windows", windows);
  RecordProperty("worst_tilt_degree", std::to_string(worst_tilt * 180 / std::numbers::pi));
  RecordProperty("worst_gyro_radps", std::to_string(worst_gyro));
  RecordProperty("worst_velocity_mps", std::to_string(worst_velocity));
  EXPECT_LT(worst_tilt, 0.03);  // what it promises to refuse beyond
  EXPECT_LT(worst_gyro, 0.01);
  EXPECT_LT(worst_velocity, 0.1);
}

}  // namespace
}  // namespace geoflow::slam
