#include "inertial/health.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "slam/inertial/motion.hpp"

namespace geoflow::slam {
namespace {

using std::chrono::milliseconds;

constexpr Duration kFrame = milliseconds{33};

/// Innovations as chance makes them, times `scale` squared.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : random_{tests::test_seed(seed)} {}

  Innovation operator()(int dimensions, double scale = 1) {
    std::chi_squared_distribution<double> chi_squared{static_cast<double>(dimensions)};
    return {scale * scale * chi_squared(random_), dimensions};
  }

 private:
  std::mt19937_64 random_;
};

/// Runs `frames` frames and returns the last judgement.
template <typename Make>
ImuJudgement run(ImuHealth& health, HostTime& t, int frames, Make&& make) {
  for (int i = 0; i < frames; ++i) {
    t += kFrame;
    health.update(t, make());
  }
  return health.judgement();
}

TEST(ImuHealth, ChanceAloneIsHealthy) {
  Chance chance{61};
  ImuHealth health;
  HostTime t{};
  int not_healthy = 0;
  constexpr int kFrames = 100000;
  for (int i = 0; i < kFrames; ++i) {
    const ImuJudgement at =
        run(health, t, 1, [&] { return ImuInnovations{chance(6), chance(3), chance(6)}; });
    ASSERT_NE(at.verdict, ImuVerdict::kDiverged);
    ASSERT_EQ(at.predictor, PoseSource::kImu);
    not_healthy += at.verdict == ImuVerdict::kHealthy ? 0 : 1;
  }
  RecordProperty("suspect_share", std::to_string(not_healthy / double{kFrames}));
  EXPECT_LT(not_healthy, kFrames / 500);
}

TEST(ImuHealth, NoiseThatIsHalfAgainAsLargeIsStillHealthy) {
  Chance chance{62};
  ImuHealth health;
  HostTime t{};
  int diverged = 0;
  for (int i = 0; i < 5000; ++i) {
    const ImuJudgement at = run(
        health, t, 1, [&] { return ImuInnovations{chance(6, 1.2), chance(3, 1.2), std::nullopt}; });
    diverged += at.verdict == ImuVerdict::kDiverged ? 1 : 0;
  }
  EXPECT_EQ(diverged, 0);
}

TEST(ImuHealth, DivergesAgainstCameraAndLegsAndRecovers) {
  Chance chance{63};
  ImuHealth health;
  HostTime t{};
  run(health, t, 100, [&] { return ImuInnovations{chance(6), chance(3), chance(6)}; });
  const ImuJudgement bad =
      run(health, t, 15, [&] { return ImuInnovations{chance(6, 5), chance(3, 5), chance(6, 2)}; });
  EXPECT_EQ(bad.verdict, ImuVerdict::kDiverged);
  EXPECT_EQ(bad.predictor, PoseSource::kLegs);
  EXPECT_GT(bad.variance_scale, 9);
  EXPECT_LT(bad.variance_scale, 50);
  const ImuJudgement good =
      run(health, t, 60, [&] { return ImuInnovations{chance(6), chance(3), chance(6)}; });
  EXPECT_EQ(good.verdict, ImuVerdict::kHealthy);
  EXPECT_EQ(good.variance_scale, 1);
  EXPECT_EQ(good.predictor, PoseSource::kImu);
}

TEST(ImuHealth, HysteresisHoldsAVerdict) {
  ImuHealth health;
  HostTime t{};
  const auto at = [&](double per_dimension) {
    return run(health, t, 100, [&] {
      return ImuInnovations{Innovation{6 * per_dimension, 6}, std::nullopt, std::nullopt};
    });
  };
  EXPECT_EQ(at(6).verdict, ImuVerdict::kSuspect);
  EXPECT_EQ(at(12).verdict, ImuVerdict::kDiverged);
  EXPECT_EQ(at(6).verdict, ImuVerdict::kDiverged);
  EXPECT_EQ(at(3).verdict, ImuVerdict::kSuspect);
  EXPECT_EQ(at(1.8).verdict, ImuVerdict::kSuspect);
  EXPECT_EQ(at(1).verdict, ImuVerdict::kHealthy);
  EXPECT_EQ(at(1.8).verdict, ImuVerdict::kHealthy);
}

TEST(ImuHealth, ASlippingLegDoesNotCondemnTheImu) {
  Chance chance{64};
  ImuHealth health;
  HostTime t{};
  const ImuJudgement at =
      run(health, t, 100, [&] { return ImuInnovations{chance(6), chance(3, 20), chance(6)}; });
  EXPECT_EQ(at.verdict, ImuVerdict::kSuspect);
  EXPECT_EQ(at.predictor, PoseSource::kImu);
  EXPECT_LT(at.variance_scale, 2);  // the camera vouches for it
}

TEST(ImuHealth, ConstantVelocityDecidesWhereNothingElseSpeaks) {
  Chance chance{65};
  ImuHealth health;
  HostTime t{};
  const ImuJudgement at =
      run(health, t, 30, [&] { return ImuInnovations{std::nullopt, std::nullopt, chance(6, 6)}; });
  EXPECT_EQ(at.verdict, ImuVerdict::kDiverged);
  EXPECT_EQ(at.predictor, PoseSource::kNone);
  EXPECT_GT(at.variance_scale, 9);
}

TEST(ImuHealth, OneShockMakesADoubtAndNoMore) {
  Chance chance{66};
  ImuHealth health;
  HostTime t{};
  run(health, t, 100, [&] { return ImuInnovations{chance(6), chance(3), chance(6)}; });
  const ImuJudgement shock = run(health, t, 1, [&] {
    return ImuInnovations{Innovation{1e9, 6}, Innovation{1e9, 3}, Innovation{1e9, 6}};
  });
  EXPECT_EQ(shock.verdict, ImuVerdict::kSuspect);
  EXPECT_EQ(shock.predictor, PoseSource::kImu);
}

TEST(ImuHealth, WhatIsNotANumberIsNoAgreement) {
  ImuHealth health;
  HostTime t{};
  const ImuJudgement at = run(health, t, 20, [&] {
    return ImuInnovations{Innovation{std::numeric_limits<double>::quiet_NaN(), 6}, std::nullopt,
                          std::nullopt};
  });
  EXPECT_EQ(at.verdict, ImuVerdict::kDiverged);
}

TEST(ImuHealth, SilentWitnessesAreForgotten) {
  Chance chance{67};
  ImuHealth health;
  HostTime t{};
  run(health, t, 30, [&] { return ImuInnovations{chance(6), chance(3, 9), std::nullopt}; });
  const ImuJudgement at =
      run(health, t, 30, [&] { return ImuInnovations{chance(6), std::nullopt, std::nullopt}; });
  EXPECT_EQ(at.verdict, ImuVerdict::kHealthy);
  EXPECT_EQ(at.mean_squared[static_cast<std::size_t>(ImuWitness::kLegs)], 0);
}

/// The whole way: frames of 33 ms, each predicted from the true state before it, against a camera
/// of 5 mm and 3 mrad and legs of 0.05 m/s. From 2 s to 3 s the accelerometer is off by 30 m/s^2 on
/// each axis.
TEST(ImuHealth, FindsAnAccelerometerThatIsOff) {
  std::mt19937_64 random{tests::test_seed(68)};
  const inertial_tests::SineMotion motion{random};
  auto samples = inertial_tests::noisy_samples(motion, HostTime{}, HostTime{milliseconds{5000}}, {},
                                               ImuNoise{}, random);
  for (std::size_t i = 400; i < 600; ++i) {
    samples[i].sample.accel_mps2 += Vector3d::Constant(30) + 5 * inertial_tests::normal3(random);
  }
  const auto plain = unscreened(samples);
  Matrix6d camera = Matrix6d::Zero();
  camera.diagonal() << Vector3d::Constant(9e-6), Vector3d::Constant(25e-6);
  const Matrix3d legs = 25e-4 * Matrix3d::Identity();
  ImuHealth health;
  std::optional<double> diverged_s;
  std::optional<double> healthy_again_s;
  for (HostTime t{}; t + kFrame < HostTime{milliseconds{5000}}; t += kFrame) {
    const auto measured = preintegrate(plain, t, t + kFrame, {}, ImuNoise{});
    ASSERT_TRUE(measured.has_value());
    const UncertainState predicted =
        predict({motion.state(t), StateMatrix::Zero()}, *measured, gravity_down());
    const NavState truth = motion.state(t + kFrame);
    Vector6d error;
    error << 3e-3 * inertial_tests::normal3(random), 5e-3 * inertial_tests::normal3(random);
    const ImuJudgement at = health.update(
        t + kFrame, {pose_innovation(predicted, truth.T_odom_imu * SE3::exp(error), camera),
                     velocity_innovation(
                         predicted, truth.v_odom + 0.05 * inertial_tests::normal3(random), legs),
                     std::nullopt});
    const double now_s = to_seconds(t.time_since_epoch());
    if (now_s < 1.9) {
      ASSERT_EQ(at.verdict, ImuVerdict::kHealthy) << now_s;
    }
    if (at.verdict == ImuVerdict::kDiverged && !diverged_s) {
      diverged_s = now_s;
    }
    if (diverged_s && at.verdict == ImuVerdict::kHealthy && !healthy_again_s) {
      healthy_again_s = now_s;
    }
  }
  ASSERT_TRUE(diverged_s && healthy_again_s);
  RecordProperty("diverged_s", std::to_string(*diverged_s));
  RecordProperty("healthy_again_s", std::to_string(*healthy_again_s));
  EXPECT_LT(*diverged_s, 2.5);
  EXPECT_GT(*healthy_again_s, 2.9);
  EXPECT_LT(*healthy_again_s, 4.8);  // 50 falls below 1.5 in 44 frames
}

}  // namespace
}  // namespace geoflow::slam
