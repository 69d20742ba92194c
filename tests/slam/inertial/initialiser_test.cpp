#include "inertial/initialiser.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/nav_state.hpp"
#include "slam/inertial/motion.hpp"

namespace geoflow::slam {
namespace {

using inertial_tests::normal3;
using std::chrono::milliseconds;

constexpr double kDegree = std::numbers::pi / 180;
constexpr Duration kPeriod = milliseconds{5};

/// What a still IMU with the default noise measures, and motors on top: sines at 90 to 140 Hz, far
/// above what the sampling resolves.
class StillImu {
 public:
  StillImu(std::mt19937_64& random, const BiasPrior& prior, double motors_mps2 = 0)
      : random_{random}, motors_mps2_{motors_mps2} {
    R_odom_imu_ = so3::exp(normal3(random));
    const std::normal_distribution<double> normal;
    const BiasMatrix root = prior.covariance.llt().matrixL();
    Vector6d z;
    z << normal3(random), normal3(random);
    bias_ = ImuBias::from(prior.bias.vector() + root * z);
  }

  ImuSample operator()(HostTime t) {
    const double root = std::sqrt(noise_.rate_hz);
    const double t_s = to_seconds(t.time_since_epoch());
    const Vector3d shake{std::sin(600 * t_s), std::sin(733 * t_s + 1), std::sin(871 * t_s + 2)};
    return {.accel_mps2 = up() * kStandardGravity + bias_.accel_mps2 + motors_mps2_ * shake +
                          root * noise_.accel_noise_density * normal3(random_),
            .gyro_radps = bias_.gyro_radps + 0.05 * motors_mps2_ * shake +
                          root * noise_.gyro_noise_density * normal3(random_)};
  }

  [[nodiscard]] Vector3d up() const { return R_odom_imu_.conjugate() * Vector3d::UnitZ(); }
  [[nodiscard]] const ImuBias& bias() const { return bias_; }
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }

 private:
  std::mt19937_64& random_;
  ImuNoise noise_{};
  double motors_mps2_;
  Eigen::Quaterniond R_odom_imu_;
  ImuBias bias_;
};

template <typename Source>
void feed(StandingInitialiser& initialiser, Source&& source, HostTime begin, Duration duration) {
  for (HostTime t = begin; t <= begin + duration; t += kPeriod) {
    initialiser.add(t, source(t));
  }
}

/// (tilt in the plane across up, gyro bias, accel bias) by which the truth differs from the fix.
Eigen::Matrix<double, 9, 1> error_of(const StandingFix& fix, const StillImu& imu) {
  const Vector3d up_imu = fix.R_odom_imu.conjugate() * Vector3d::UnitZ();
  Eigen::Matrix<double, 9, 1> error;
  // up = exp(phi)^T up_imu, so phi = up x up_imu for small angles.
  error << imu.up().cross(up_imu), imu.bias().gyro_radps - fix.bias.gyro_radps,
      imu.bias().accel_mps2 - fix.bias.accel_mps2;
  return error;
}

/// Normalised error squared per dimension; the rotation about the vertical is exact by definition.
double nees_of(const StandingFix& fix, const StillImu& imu) {
  constexpr int kDimensions = 8;
  const auto error = error_of(fix, imu);
  const Vector3d up_imu = fix.R_odom_imu.conjugate() * Vector3d::UnitZ();
  Eigen::Matrix<double, 9, 9> covariance = fix.covariance;
  EXPECT_LT((covariance.topLeftCorner<3, 3>() * up_imu).norm(), 1e-12);
  covariance.topLeftCorner<3, 3>() += up_imu * up_imu.transpose();
  return error.dot(covariance.ldlt().solve(error)) / kDimensions;
}

TEST(StandingInitialiser, ErrorsAreAsLargeAsTheCovarianceSays) {
  std::mt19937_64 random{tests::test_seed(21)};
  for (const double motors : {0.0, 0.5}) {
    double nees = 0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      StillImu imu{random, BiasPrior::cold(), motors};
      StandingInitialiser initialiser{imu.noise()};
      feed(initialiser, imu, HostTime{}, milliseconds{2500});
      const Result<StandingFix> fix = initialiser.fix();
      // One in thousands has a bias beyond what the cold prior takes for standing.
      if (!fix) {
        EXPECT_GT(imu.bias().vector().cwiseAbs().maxCoeff(), 0.1) << fix.error().message;
        continue;
      }
      nees += nees_of(*fix, imu) / kRuns;
    }
    RecordProperty("nees_per_dof_motors_" + std::to_string(motors), std::to_string(nees));
    // Variances are the larger of two estimates, so somewhat cautious.
    EXPECT_GT(nees, 0.7) << motors;
    EXPECT_LT(nees, 1.1) << motors;
  }
}

TEST(StandingInitialiser, WarmStartNarrowsTheTilt) {
  std::mt19937_64 random{tests::test_seed(22)};
  const auto tilt_variance = [](const StandingFix& fix) {
    return fix.covariance.diagonal().head<3>().sum();
  };
  double nees = 0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    BiasPrior saved;
    saved.bias = {0.01 * normal3(random), 0.1 * normal3(random)};
    saved.covariance.diagonal() << Vector3d::Constant(1e-6), Vector3d::Constant(1e-4);
    StillImu imu{random, saved};
    StandingInitialiser cold{imu.noise()};
    StandingInitialiser warm{imu.noise(), saved};
    for (HostTime t{}; t <= HostTime{milliseconds{1500}}; t += kPeriod) {
      const ImuSample sample = imu(t);
      cold.add(t, sample);
      warm.add(t, sample);
    }
    const auto cold_fix = cold.fix();
    const auto warm_fix = warm.fix();
    ASSERT_TRUE(cold_fix && warm_fix);
    EXPECT_FALSE(warm_fix->prior_rejected);
    EXPECT_LT(tilt_variance(*warm_fix), 0.02 * tilt_variance(*cold_fix));
    nees += nees_of(*warm_fix, imu) / kRuns;
  }
  RecordProperty("nees_per_dof", std::to_string(nees));
  EXPECT_GT(nees, 0.7);
  EXPECT_LT(nees, 1.1);
}

TEST(StandingInitialiser, APriorThatContradictsIsRejected) {
  std::mt19937_64 random{tests::test_seed(23)};
  BiasPrior prior;
  prior.covariance.diagonal() << Vector3d::Constant(1e-6), Vector3d::Constant(1e-4);
  BiasPrior moved = prior;
  moved.bias.gyro_radps.x() = 0.05;
  StillImu imu{random, prior};
  StandingInitialiser initialiser{imu.noise(), moved};
  feed(initialiser, imu, HostTime{}, milliseconds{2000});
  const auto fix = initialiser.fix();
  ASSERT_TRUE(fix.has_value());
  EXPECT_TRUE(fix->prior_rejected);
  EXPECT_LT(error_of(*fix, imu).segment<3>(3).norm(), 0.01);
}

TEST(StandingInitialiser, WaitsASecondAndSaysSo) {
  std::mt19937_64 random{tests::test_seed(24)};
  StillImu imu{random, BiasPrior::cold()};
  StandingInitialiser initialiser{imu.noise()};
  feed(initialiser, imu, HostTime{}, milliseconds{700});
  const auto fix = initialiser.fix();
  ASSERT_FALSE(fix.has_value());
  EXPECT_EQ(fix.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(fix.error().message.find("0.6 s of the 1.0"), std::string::npos) << fix.error().message;
}

/// A robot's walk is never taken for standing, whatever its phase.
TEST(StandingInitialiser, NeverFixesWhileMoving) {
  std::mt19937_64 random{tests::test_seed(25)};
  for (int trial = 0; trial < 30; ++trial) {
    const inertial_tests::SineMotion motion{random};
    StandingInitialiser initialiser{ImuNoise{}};
    for (const auto& timed :
         inertial_tests::perfect_samples(motion, HostTime{}, HostTime{milliseconds{8000}}, 200)) {
      initialiser.add(timed.t, timed.sample);
      ASSERT_FALSE(initialiser.fix().has_value());
    }
  }
}

TEST(StandingInitialiser, ForgetsWhatCameBeforeAMotion) {
  std::mt19937_64 random{tests::test_seed(26)};
  StillImu imu{random, BiasPrior::cold()};
  StillImu tilted{random, BiasPrior::cold()};
  StandingInitialiser initialiser{imu.noise()};
  feed(initialiser, imu, HostTime{}, milliseconds{3000});
  EXPECT_TRUE(initialiser.fix().has_value());
  feed(initialiser, tilted, HostTime{milliseconds{3005}}, milliseconds{300});
  EXPECT_FALSE(initialiser.fix().has_value());
  feed(initialiser, tilted, HostTime{milliseconds{3310}}, milliseconds{2000});
  const auto fix = initialiser.fix();
  ASSERT_TRUE(fix.has_value());
  EXPECT_LT(fix->stood, milliseconds{2350});
  EXPECT_LT(error_of(*fix, tilted).head<3>().norm(), 0.1);
}

TEST(StandingInitialiser, IgnoresRepeatsAndDamageAndStartsAnewAfterAGap) {
  std::mt19937_64 random{tests::test_seed(27)};
  StillImu imu{random, BiasPrior::cold()};
  StandingInitialiser initialiser{imu.noise()};
  feed(initialiser, imu, HostTime{}, milliseconds{1500});
  const auto before = initialiser.fix();
  ASSERT_TRUE(before.has_value());
  ImuSample wild{.accel_mps2 = {500, 0, 0}, .gyro_radps = Vector3d::Zero()};
  initialiser.add(HostTime{milliseconds{1500}}, wild);  // not newer
  wild.accel_mps2.x() = std::numeric_limits<double>::quiet_NaN();
  initialiser.add(HostTime{milliseconds{1505}}, wild);
  const auto after = initialiser.fix();
  ASSERT_TRUE(after.has_value());
  EXPECT_EQ(before->bias.vector(), after->bias.vector());
  initialiser.add(HostTime{milliseconds{2000}}, imu(HostTime{milliseconds{2000}}));
  EXPECT_FALSE(initialiser.fix().has_value());
}

TEST(StandingInitialiser, ForceFarFromGravityIsRefused) {
  StandingInitialiser initialiser{ImuNoise{}};
  feed(
      initialiser,
      [](HostTime) { return ImuSample{.accel_mps2 = {0, 0, 8.0}, .gyro_radps = Vector3d::Zero()}; },
      HostTime{}, milliseconds{2000});
  const auto fix = initialiser.fix();
  ASSERT_FALSE(fix.has_value());
  EXPECT_NE(fix.error().message.find("8.00 m/s^2"), std::string::npos) << fix.error().message;
}

TEST(StandingInitialiser, YawIsZeroForTheForwardAxis) {
  const Vector3d up = Vector3d{0.1, -0.9, 0.3}.normalized();
  const Vector3d forward = Vector3d::UnitZ();  // an optical frame's
  const Eigen::Quaterniond R_odom_imu = level_rotation(up, forward);
  const Vector3d ahead = R_odom_imu * forward;
  EXPECT_NEAR(ahead.y(), 0, 1e-12);
  EXPECT_GT(ahead.x(), 0);
  EXPECT_LT((R_odom_imu * up - Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_LT((level_rotation(up, up) * up - Vector3d::UnitZ()).norm(), 1e-12);
}

/// Real data: a drone on the ground with its rotors on.
TEST(StandingInitialiser, FindsGravityAndGyroBiasOfEuroc) {
  GEOFLOW_DATA_OR_SKIP(folder, "euroc-v102");
  StandingInitialiser initialiser{inertial_tests::euroc_noise()};
  const auto samples = inertial_tests::read_euroc_imu(folder);
  Result<StandingFix> fix = fail(ErrorCode::kUnavailable, "never stood");
  HostTime last_fix{};
  for (const auto& timed : samples) {
    initialiser.add(timed.t, timed.sample);
    if (const auto now = initialiser.fix()) {
      last_fix = timed.t;
      if (timed.t - samples.front().t < milliseconds{3000}) {
        fix = now;
      }
    }
  }
  ASSERT_TRUE(fix.has_value()) << fix.error().message;
  // It takes off 4 s after the start and lands in the last second.
  const double end_s = to_seconds(samples.back().t - samples.front().t);
  const double last_s = to_seconds(last_fix - samples.front().t);
  EXPECT_TRUE(last_s < 4.5 || last_s > end_s - 2) << last_s;

  const auto truth = inertial_tests::read_euroc_truth(folder);
  const NavState& state = truth.at(100).state;
  const Vector3d up_true = state.T_odom_imu.rotation().conjugate() * Vector3d::UnitZ();
  const Vector3d up_imu = fix->R_odom_imu.conjugate() * Vector3d::UnitZ();
  const double tilt = std::acos(std::min(1.0, up_true.dot(up_imu)));
  const double gyro = (fix->bias.gyro_radps - state.bias.gyro_radps).norm();
  RecordProperty("tilt_degree", std::to_string(tilt / kDegree));
  RecordProperty("gyro_bias_error_radps", std::to_string(gyro));
  // Three times what an unknown accelerometer bias of 0.2 m/s^2 tilts it by.
  EXPECT_LT(tilt, 3 * 0.2 / kStandardGravity);
  // In each second that it stands, the mean about z is 0.002 rad/s above the truth's bias, which
  // the truth holds constant to 2e-5 over the flight: its own error.
  EXPECT_LT(gyro, 3e-3);

  // With the biases of a run before, as a warm start has them.
  BiasPrior saved;
  saved.bias = state.bias;
  saved.covariance.diagonal() << Vector3d::Constant(1e-6), Vector3d::Constant(4e-4);
  StandingInitialiser warm{inertial_tests::euroc_noise(), saved};
  for (const auto& timed : samples) {
    if (timed.t - samples.front().t < milliseconds{3000}) {
      warm.add(timed.t, timed.sample);
    }
  }
  const auto warm_fix = warm.fix();
  ASSERT_TRUE(warm_fix.has_value()) << warm_fix.error().message;
  const Vector3d warm_up = warm_fix->R_odom_imu.conjugate() * Vector3d::UnitZ();
  const double warm_tilt = std::acos(std::min(1.0, up_true.dot(warm_up)));
  RecordProperty("warm_tilt_degree", std::to_string(warm_tilt / kDegree));
  EXPECT_FALSE(warm_fix->prior_rejected);
  EXPECT_LT(warm_tilt, 0.5 * kDegree);
}

/// Real data: a Go1 lies for a second, stands up, and trots from 4 s on.
TEST(StandingInitialiser, FindsGravityOfALyingGo1AndNeverWhileItWalks) {
  GEOFLOW_DATA_OR_SKIP(folder, "go1-legs");
  StandingInitialiser initialiser{ImuNoise{}};
  std::vector<double> fixes;
  Result<StandingFix> first = fail(ErrorCode::kUnavailable, "never stood");
  for (const auto& timed : inertial_tests::read_go1_imu(folder)) {
    initialiser.add(timed.t, timed.sample);
    if (const auto fix = initialiser.fix()) {
      fixes.push_back(to_seconds(timed.t.time_since_epoch()));
      first = first ? first : fix;
    }
  }
  ASSERT_TRUE(first.has_value()) << first.error().message;
  EXPECT_LT(fixes.back(), 4.0);
  const Vector3d up_imu = first->R_odom_imu.conjugate() * Vector3d::UnitZ();
  const auto euler = inertial_tests::read_csv(folder / "Orient_mocap_euler.csv");
  const auto row = static_cast<std::size_t>(to_seconds(first->t.time_since_epoch()) * 200);
  const Vector3d up_true{-std::sin(euler.at(row).at(2)),
                         std::sin(euler[row].at(1)) * std::cos(euler[row][2]),
                         std::cos(euler[row][1]) * std::cos(euler[row][2])};
  const double tilt = std::acos(std::min(1.0, up_true.dot(up_imu)));
  RecordProperty("tilt_degree", std::to_string(tilt / kDegree));
  RecordProperty("gyro_bias_radps", std::to_string(first->bias.gyro_radps.norm()));
  EXPECT_LT(tilt, 3 * 0.2 / kStandardGravity);
  EXPECT_LT(first->bias.gyro_radps.norm(), 2e-3);  // it was zeroed by the robot
}

}  // namespace
}  // namespace geoflow::slam
