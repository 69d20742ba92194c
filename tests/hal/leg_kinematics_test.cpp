#include "geoflow/hal/leg_kinematics.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "tests/support/data.hpp"
#include "tests/support/go2_check_values.hpp"

namespace geoflow {
namespace {

constexpr std::array kLegs{Leg::kFrontRight, Leg::kFrontLeft, Leg::kRearRight, Leg::kRearLeft};

/// Angles within Go2's joint limits.
Vector3d random_angles(std::mt19937_64& random) {
  return {std::uniform_real_distribution{-1.0472, 1.0472}(random),
          std::uniform_real_distribution{-0.5236, 3.4907}(random),
          std::uniform_real_distribution{-2.7227, -0.83776}(random)};
}

TEST(LegKinematics, MeetsTheCheckValues) {
  for (const tests::CheckValue& check : tests::go2_check_values()) {
    EXPECT_LT((foot_position(kGo2Legs, check.leg, check.q) - check.foot).norm(), 1e-9);
  }
  Matrix3d expected;
  expected << 0, -0.192266593, -0.115084391, 0.213356732, -0.006614844, 0.061458712, -0.023782301,
      0.018121444, -0.168366890;
  EXPECT_LT((foot_jacobian(kGo2Legs, Leg::kFrontRight, {0.35, 1.2, -2.2}) - expected).norm(), 2e-9);
}

TEST(LegKinematics, InverseInvertsForward) {
  std::mt19937_64 random{tests::test_seed(11)};
  int checked = 0;
  for (int i = 0; i < 5000; ++i) {
    const Leg leg = kLegs.at(static_cast<std::size_t>(i) % kLegCount);
    const Vector3d q = random_angles(random);
    const double below_hip = 0.213 * (std::cos(q.y()) + std::cos(q.y() + q.z()));
    if (below_hip < 0.02) {
      continue;  // folded up to the hip's axis: another posture has the same foot
    }
    for (const LegGeometry& geometry : {kGo2Legs, kGo1Legs}) {
      const std::optional<Vector3d> found =
          joint_angles(geometry, leg, foot_position(geometry, leg, q));
      ASSERT_TRUE(found.has_value()) << q.transpose();
      const Vector3d back = foot_position(geometry, leg, *found);
      EXPECT_LT((back - foot_position(geometry, leg, q)).norm(), 1e-12);
      EXPECT_LT((*found - q).norm(), 1e-9) << q.transpose();
    }
    ++checked;
  }
  EXPECT_GT(checked, 3000);
}

TEST(LegKinematics, InverseRefusesWhatTheLegDoesNotReach) {
  const Vector3d hip = hip_position(kGo2Legs, Leg::kRearLeft);
  EXPECT_FALSE(joint_angles(kGo2Legs, Leg::kRearLeft, hip + Vector3d{0, 0.0955, -0.4261}));
  EXPECT_TRUE(joint_angles(kGo2Legs, Leg::kRearLeft, hip + Vector3d{0, 0.0955, -0.4259}));
  EXPECT_FALSE(joint_angles(kGo2Legs, Leg::kRearLeft, hip + Vector3d{0.1, 0.05, -0.05}));
  EXPECT_FALSE(joint_angles(kGo2Legs, Leg::kRearLeft, hip + Vector3d{0, std::nan(""), -0.3}));
}

TEST(LegKinematics, JacobiansAreTheDerivatives) {
  std::mt19937_64 random{tests::test_seed(12)};
  const Vector3d normal = Vector3d{0.1, -0.2, 1}.normalized();
  constexpr double kStep = 1e-6;
  constexpr double kRadius = 0.017;
  for (int i = 0; i < 200; ++i) {
    const Leg leg = kLegs.at(static_cast<std::size_t>(i) % kLegCount);
    const Vector3d q = random_angles(random);
    const FootContact contact = foot_contact(kGo2Legs, leg, q, normal, kRadius);
    // The material point's place in the calf's frame, which the joints do not change.
    const Vector3d in_calf =
        calf_rotation(q).transpose() * (contact.point - foot_position(kGo2Legs, leg, q));
    for (Eigen::Index joint = 0; joint < 3; ++joint) {
      const Vector3d plus = q + kStep * Vector3d::Unit(joint);
      const Vector3d minus = q - kStep * Vector3d::Unit(joint);
      const Vector3d foot =
          (foot_position(kGo2Legs, leg, plus) - foot_position(kGo2Legs, leg, minus)) / (2 * kStep);
      EXPECT_LT((foot - foot_jacobian(kGo2Legs, leg, q).col(joint)).norm(), 1e-9);
      const Vector3d offset =
          (calf_rotation(plus) * in_calf - calf_rotation(minus) * in_calf) / (2 * kStep);
      EXPECT_LT((foot + offset - contact.jacobian.col(joint)).norm(), 1e-9);
      const Matrix3d turned = calf_rotation(plus) * calf_rotation(minus).transpose();
      const Vector3d rate = so3::log(Eigen::Quaterniond{turned}) / (2 * kStep);
      EXPECT_LT((rate - calf_rate_jacobian(q).col(joint)).norm(), 1e-8);
    }
  }
}

TEST(LegKinematics, ARollingFootGivesTheBodysVelocity) {
  // A leg with a locked knee pivots like a wheel's spoke over its foot: the sphere's centre moves
  // by (radius * rate) more than "the foot stands still" says.
  const Vector3d q{0, 0.9, -1.8};
  constexpr double kPitchRate = 0.7;
  const Vector3d w_base{0, kPitchRate, 0};
  const FootContact contact =
      foot_contact(kGo2Legs, Leg::kFrontRight, q, Vector3d::UnitZ(), kGo2Legs.foot_radius_m);
  const Vector3d v = base_velocity_from_stance(contact, Vector3d::Zero(), w_base);
  EXPECT_NEAR(v.x(), -kPitchRate * contact.point.z(), 1e-12);
  EXPECT_NEAR(v.z(), kPitchRate * contact.point.x(), 1e-12);
  EXPECT_NEAR(contact.point.z(), -0.264805846 - 0.022 - 0.002 * std::sin(0.9), 1e-9);
}

TEST(LegKinematics, RefusesTheForceOfASingularLeg) {
  EXPECT_FALSE(ground_force(foot_jacobian(kGo2Legs, Leg::kRearLeft, {0, 0.3, 0}), {1, 1, 1}));
  const Matrix3d J = foot_jacobian(kGo2Legs, Leg::kRearLeft, {0.1, 0.9, -1.8});
  const Vector3d force{3, -2, 40};
  const std::optional<Vector3d> found = ground_force(J, -J.transpose() * force);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - force).norm(), 1e-12);
}

TEST(LegKinematics, FindsTheWeightOfARealStandingGo2) {
  GEOFLOW_DATA_OR_SKIP(folder, "go2-trot");
  LegSample sample;
  std::ifstream file{folder / "go2_real_standing_and_lying.csv"};
  std::string line;
  while (std::getline(file, line)) {
    std::stringstream fields{line};
    std::vector<std::string> field;
    for (std::string text; std::getline(fields, text, ',');) {
      field.push_back(text);
    }
    if (field.size() == 7 && field[0] == "standing" && std::stoul(field[1]) < 12) {
      sample.joints.at(std::stoul(field[1])) = {.q_rad = std::stod(field[3]),
                                                .dq_radps = std::stod(field[4]),
                                                .tau_nm = std::stod(field[5])};
    }
  }
  Vector3d sum = Vector3d::Zero();
  for (const Leg leg : kLegs) {
    const LegJoints joints = joints_of(sample, leg);
    const std::optional<Vector3d> force =
        ground_force(foot_jacobian(kGo2Legs, leg, joints.q_rad), joints.tau_nm);
    ASSERT_TRUE(force.has_value());
    sum += *force;
  }
  EXPECT_NEAR(sum.x(), 3.9, 0.1);
  EXPECT_NEAR(sum.y(), -0.6, 0.1);
  EXPECT_NEAR(sum.z(), 147.3, 0.1);
}

}  // namespace
}  // namespace geoflow
