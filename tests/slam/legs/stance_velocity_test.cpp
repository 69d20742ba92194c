#include "legs/stance_velocity.hpp"

#include <array>
#include <cstddef>
#include <optional>
#include <random>
#include <string>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "tests/support/data.hpp"

#include "legs/contact.hpp"
#include "legs/foot_motion.hpp"
#include "legs/leg_config.hpp"

namespace geoflow::slam {
namespace {

const LegConfig leg_config{};
const Vector3d v_base{0.6, -0.1, 0.05};
const BaseTurn base_turn{.w_base_radps = {0.2, -0.3, 0.5}, .sigma_radps = 0.01};

/// A leg of a robot that moves by v_base and base_turn, whose touching point moves over ground
/// by `v_slip_base`.
FootMotion leg_in_motion(Leg leg, const Vector3d& v_slip_base, const Vector3d& noise) {
  LegJoints joints;
  joints.q_rad = {0.1, 0.8 + 0.1 * static_cast<double>(leg), -1.6};
  const FootContact contact = foot_contact(leg_config.geometry, leg, joints.q_rad,
                                           base_turn.up_base, leg_config.geometry.foot_radius_m);
  joints.dq_radps = contact.jacobian.inverse() *
                        (v_slip_base - v_base - base_turn.w_base_radps.cross(contact.point)) +
                    noise;
  return foot_motion(leg_config, leg, joints, base_turn);
}

ContactEstimator::Feet settled(std::array<bool, kLegCount> stands) {
  ContactEstimator::Feet feet;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    feet.at(leg) = {
        .probability = stands.at(leg) ? 1.0 : 0.0, .stands = stands.at(leg), .stance_s = 1};
  }
  return feet;
}

FootMotions robot(const Vector3d& v_slip_base, std::size_t slipping) {
  FootMotions motions;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    motions.at(leg) = leg_in_motion(
        static_cast<Leg>(leg), leg == slipping ? v_slip_base : Vector3d{0, 0, 0}, Vector3d::Zero());
  }
  return motions;
}

TEST(StanceVelocity, EachStandingLegGivesTheBodysVelocity) {
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    std::array<bool, kLegCount> stands{};
    stands.at(leg) = true;
    StanceVelocityEstimator estimator{leg_config.noise};
    const StanceVelocity found =
        estimator.update(robot(Vector3d::Zero(), 0), settled(stands), std::nullopt);
    EXPECT_EQ(found.legs, 1);
    EXPECT_LT((found.velocity.v_base_mps - v_base).norm(), 1e-12);
  }
}

TEST(StanceVelocity, CovarianceIsConsistentWithTheRatesNoise) {
  std::mt19937_64 random{tests::test_seed(31)};
  std::normal_distribution<double> normal;
  constexpr int kTrials = 2000;
  double nees = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    FootMotions motions;
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const Vector3d slip =
          leg_config.noise.speed_mps * Vector3d{normal(random), normal(random), normal(random)};
      const Vector3d noise = leg_config.noise.dq_radps.cwiseProduct(
          Vector3d{normal(random), normal(random), normal(random)});
      motions.at(leg) = leg_in_motion(static_cast<Leg>(leg), slip, noise);
    }
    StanceVelocityEstimator estimator{leg_config.noise};
    const VelocityBelief found =
        estimator.update(motions, settled({true, false, false, true}), std::nullopt).velocity;
    const Vector3d error = found.v_base_mps - v_base;
    nees += error.dot(found.covariance.inverse() * error) / 3 / kTrials;
  }
  RecordProperty("nees_per_dof", std::to_string(nees));
  // The covariance counts the gyroscope's noise, which this test leaves out.
  EXPECT_GT(nees, 0.8);
  EXPECT_LT(nees, 1.1);
}

TEST(StanceVelocity, FindsTheFootThatSlipsAmongFour) {
  for (std::size_t slipping = 0; slipping < kLegCount; ++slipping) {
    StanceVelocityEstimator estimator{leg_config.noise};
    StanceVelocity found;
    for (int sample = 0; sample < 3; ++sample) {
      found = estimator.update(robot({0.4, 0.3, 0}, slipping), settled({true, true, true, true}),
                               std::nullopt);
      EXPECT_EQ(found.slips.at(slipping), sample == 2);
    }
    EXPECT_GT(found.pair_rate, 3);
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      EXPECT_EQ(found.slips.at(leg), leg == slipping);
    }
    EXPECT_LT((found.velocity.v_base_mps - v_base).norm(), 0.02);
  }
}

TEST(StanceVelocity, APredictionTellsWhichOfTwoFeetSlips) {
  const VelocityBelief prediction{.v_base_mps = v_base, .covariance = 1e-3 * Matrix3d::Identity()};
  StanceVelocityEstimator estimator{leg_config.noise};
  StanceVelocity found;
  for (int sample = 0; sample < 3; ++sample) {
    found =
        estimator.update(robot({0.5, 0.2, 0}, 3), settled({true, false, false, true}), prediction);
  }
  EXPECT_TRUE(found.slips[3]);
  EXPECT_FALSE(found.slips[0]);
  EXPECT_LT((found.velocity.v_base_mps - v_base).norm(), 0.03);
}

TEST(StanceVelocity, WithoutSlipThePairsKeepTheirDistance) {
  StanceVelocityEstimator estimator{leg_config.noise};
  const StanceVelocity found =
      estimator.update(robot(Vector3d::Zero(), 0), settled({true, true, true, true}), std::nullopt);
  EXPECT_LT(found.pair_rate, 1e-9);
  EXPECT_EQ(found.legs, 4);
}

}  // namespace
}  // namespace geoflow::slam
