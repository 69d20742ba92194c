#include "geoflow/tools/simulator/walk.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"
#include "tests/support/go2_check_values.hpp"

#include "src/stance_motion.hpp"
#include "walk_fixture.hpp"

namespace geoflow::simulator {
namespace {

using tests::walk_for;

double distance_to_line(const Vector2d& point) {
  const std::array<Vector2d, 5> line = tests::bent_line();
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector2d along = line.at(i + 1) - line.at(i);
    const double place =
        std::clamp((point - line.at(i)).dot(along) / along.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (point - line.at(i) - place * along).norm());
  }
  return nearest;
}

TEST(BodyTrajectory, DerivativesAreThoseOfThePose) {
  const Walk walk = walk_for(20, with_pronounced_trot({}));
  constexpr double kStep = 1e-5;
  for (double t_s = 0.1; t_s < 19.9; t_s += 0.0537) {
    const BodyState at = walk.body().at(t_s);
    const BodyState before = walk.body().at(t_s - kStep);
    const BodyState after = walk.body().at(t_s + kStep);
    const Vector3d velocity =
        (after.T_world_base.translation() - before.T_world_base.translation()) / (2 * kStep);
    EXPECT_LT((velocity - at.v_world_base).norm(), 1e-6);
    const Vector3d accel = (after.v_world_base - before.v_world_base) / (2 * kStep);
    EXPECT_LT((accel - at.a_world_base).norm(), 1e-4);
    const SE3 T_base0_base1 = before.T_world_base.inverse() * after.T_world_base;
    const Vector3d rate = so3::log(T_base0_base1.rotation()) / (2 * kStep);
    EXPECT_LT((rate - at.w_base).norm(), 1e-6);
    EXPECT_LT(((after.w_base - before.w_base) / (2 * kStep) - at.alpha_base).norm(), 1e-4);
  }
}

TEST(Walk, StandsFirstThenFollowsTheLineAndTurnsAtItsEnd) {
  WalkOptions options;
  options.stand_s = 3;
  const Walk walk = walk_for(60, options);
  const Vector3d start = walk.body().at(0).T_world_base.translation();
  double farthest = 0;
  double length_m = 0;
  Vector2d before = start.head<2>();
  for (double t_s = 0; t_s < 60; t_s += 0.02) {
    const BodyState body = walk.body().at(t_s);
    const Vector3d place = body.T_world_base.translation();
    if (t_s < 3) {
      EXPECT_LT((place - start).norm(), 2e-3) << t_s;
      EXPECT_LT(body.v_world_base.norm(), 5e-3) << t_s;
    }
    farthest = std::max(farthest, distance_to_line(place.head<2>()));
    const Vector2d planned = walk.body().planned(t_s).translation().head<2>();
    length_m += (planned - before).norm();
    before = planned;
  }
  RecordProperty("farthest_from_line_m", std::to_string(farthest));
  RecordProperty("walked_m", std::to_string(length_m));
  EXPECT_LT(farthest, 0.1);
  EXPECT_GT(length_m, 0.5 * 0.5 * 57);
}

TEST(Walk, TwoOrMoreFeetStandAlwaysAndAFootInStanceStaysToTheNanometre) {
  WalkOptions options;
  options.rolling_radius_m = 0;
  options.slip_probability = 0;
  const Walk walk = walk_for(30, options);
  std::array<Vector3d, kLegCount> placed{};
  std::array<bool, kLegCount> stood{};
  double moved = 0;
  int steps = 0;
  for (double t_s = 0; t_s < 30; t_s += 0.002) {
    const RobotState state = walk.state(t_s);
    int standing = 0;
    for (std::size_t l = 0; l < kLegCount; ++l) {
      const FootState& foot = state.feet.at(l);
      standing += static_cast<int>(foot.contact);
      if (foot.contact && !stood.at(l)) {
        placed.at(l) = foot.p_world;
        ++steps;
      }
      stood.at(l) = foot.contact;
      // The foot as the joints have it, not as the plan says.
      const FootContact centre =
          foot_contact(kGo2Legs, kAllLegs.at(l), state.legs.at(l).q_rad, Vector3d::UnitZ(), 0);
      const Vector3d in_world = state.body.T_world_base * centre.point;
      EXPECT_LT((in_world - foot.p_world).norm(), 1e-12);
      if (foot.contact) {
        moved = std::max(moved, (in_world - placed.at(l)).norm());
      } else {
        EXPECT_GT(foot.p_world.z(), kGo2Legs.foot_radius_m - 1e-12);
      }
    }
    EXPECT_GE(standing, 2) << t_s;
  }
  RecordProperty("moved_m", std::to_string(moved));
  EXPECT_GT(steps, 4 * 40);
  EXPECT_LT(moved, 1e-9);
}

TEST(Walk, ARollingFootsContactPointRestsAndGivesTheBodysVelocity) {
  WalkOptions options;
  options.slip_probability = 0;
  const Walk walk = walk_for(20, options);
  double worst = 0;
  double worst_still_foot = 0;
  for (double t_s = 4; t_s < 20; t_s += 0.00317) {
    const RobotState state = walk.state(t_s);
    const Matrix3d R_base_world = state.body.T_world_base.rotation_matrix().transpose();
    const Vector3d up_in_base = R_base_world * Vector3d::UnitZ();
    for (const Leg leg : kAllLegs) {
      const auto l = static_cast<std::size_t>(leg);
      if (!state.feet.at(l).contact) {
        continue;
      }
      const LegMotion& joints = state.legs.at(l);
      const auto error = [&](double radius_m) {
        const FootContact contact = foot_contact(kGo2Legs, leg, joints.q_rad, up_in_base, radius_m);
        const Vector3d v_base =
            base_velocity_from_stance(contact, joints.dq_radps, state.body.w_base);
        return (v_base - R_base_world * state.body.v_world_base).norm();
      };
      worst = std::max(worst, error(options.rolling_radius_m));
      worst_still_foot = std::max(worst_still_foot, error(0));
    }
  }
  RecordProperty("worst_mps", std::to_string(worst));
  RecordProperty("worst_still_foot_mps", std::to_string(worst_still_foot));
  EXPECT_LT(worst, 1e-9);
  EXPECT_GT(worst_still_foot, 0.03);  // the rolling is there to be found: 22 mm times 1.5 rad/s
}

TEST(Walk, AFootIsPutWhereUnitreesModelHasItForTheSameJoints) {
  for (const geoflow::tests::CheckValue& check : geoflow::tests::go2_check_values()) {
    const Vector3d centre = foot_contact(kGo2Legs, check.leg, check.q, Vector3d::UnitZ(), 0).point;
    const auto joints = joint_angles_of_centre(kGo2Legs, check.leg, centre);
    ASSERT_TRUE(joints.has_value());
    EXPECT_LT((*joints - check.q).norm(), 1e-9);
    EXPECT_LT((foot_position(kGo2Legs, check.leg, *joints) - check.foot).norm(), 1e-8);
  }
}

TEST(Walk, JointRatesAreTheDerivativesOfTheAngles) {
  const Walk walk = walk_for(15);
  constexpr double kStep = 1e-4;
  int checked = 0;
  for (double t_s = 1; t_s < 14; t_s += 0.0133) {
    const RobotState state = walk.state(t_s);
    const RobotState before = walk.state(t_s - kStep);
    const RobotState after = walk.state(t_s + kStep);
    for (std::size_t l = 0; l < kLegCount; ++l) {
      const bool same = before.feet.at(l).contact == after.feet.at(l).contact;
      if (!same) {
        continue;  // landing is a jump of the rates
      }
      const Vector3d rate = (after.legs.at(l).q_rad - before.legs.at(l).q_rad) / (2 * kStep);
      EXPECT_LT((rate - state.legs.at(l).dq_radps).norm(), 2e-4) << t_s;
      ++checked;
    }
  }
  EXPECT_GT(checked, 3500);
}

TEST(Walk, SlipsAndSoftGroundAreAsTheTruthSays) {
  WalkOptions options;
  options.slip_probability = 0.3;
  options.ground_sink_m = 0.015;
  const Walk walk = walk_for(30, options);
  int slips = 0;
  for (const Leg leg : kAllLegs) {
    const auto l = static_cast<std::size_t>(leg);
    for (const Stance& stance : walk.stances(leg)) {
      for (const Slip& slip : stance.slips) {
        ++slips;
        const double middle_s = 0.5 * (slip.start_s + slip.end_s);
        if (middle_s > walk.duration_s()) {
          continue;
        }
        const FootState foot = walk.state(middle_s).feet.at(l);
        EXPECT_TRUE(foot.slipping);
        // Half the way is done at the middle, where it is fastest: 1.875 times the mean.
        EXPECT_NEAR(foot.contact_mps.head<2>().norm(),
                    1.875 * slip.way_world.norm() / (slip.end_s - slip.start_s), 1e-9);
      }
    }
  }
  EXPECT_GT(slips, 20);
  double lowest = 1;
  for (double t_s = 4; t_s < 30; t_s += 0.01) {
    for (const FootState& foot : walk.state(t_s).feet) {
      lowest = std::min(lowest, foot.p_world.z());
    }
  }
  EXPECT_NEAR(lowest, kGo2Legs.foot_radius_m - 0.015, 1e-6);
}

TEST(Walk, IsTheSameForTheSameSeedAndOneKnobLeavesOtherNoiseAlone) {
  const Walk one = walk_for(12);
  const Walk same = walk_for(12);
  WalkOptions other;
  other.seed = 2;
  const Walk different = walk_for(12, other);
  WalkOptions slippery;
  slippery.slip_probability = 1;
  const Walk slipping = walk_for(12, slippery);
  const BodyState at = one.body().at(9.3);
  EXPECT_EQ(at.T_world_base.matrix(), same.body().at(9.3).T_world_base.matrix());
  EXPECT_EQ(one.state(9.3).legs.at(1).q_rad, same.state(9.3).legs.at(1).q_rad);
  EXPECT_NE(at.T_world_base.matrix(), different.body().at(9.3).T_world_base.matrix());
  EXPECT_EQ(at.T_world_base.matrix(), slipping.body().at(9.3).T_world_base.matrix());
}

TEST(Walk, RefusesWhatCannotBeWalkedByName) {
  const std::array<Vector2d, 2> one_place{Vector2d{1, 1}, Vector2d{1, 1}};
  const auto nowhere = plan_walk(one_place, {});
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("two different waypoints"), std::string::npos);
  WalkOptions options;
  options.gait_hz = 9;
  const auto too_fast = plan_walk(tests::bent_line(), options);
  ASSERT_FALSE(too_fast);
  EXPECT_NE(too_fast.error().message.find("robot.gait_hz: 9"), std::string::npos);
  options = {};
  options.speed_mps = 1.2;
  options.gait_hz = 1.5;
  options.duty = 0.75;
  options.body_height_m = 0.36;
  options.duration_s = 15;
  const auto too_far = plan_walk(tests::bent_line(), options);
  ASSERT_FALSE(too_far);
  EXPECT_NE(too_far.error().message.find("does not reach"), std::string::npos);
  const std::array<Vector2d, 2> no_place{Vector2d{0, 0}, Vector2d{std::nan(""), 1}};
  EXPECT_FALSE(plan_walk(no_place, {}));
}

TEST(Walk, ItsKnobsHoldTheirDefaults) {
  for (const Knob<WalkOptions>& knob : walk_knobs()) {
    const KnobInfo info = describe(knob);
    EXPECT_TRUE(info.name.starts_with("robot."));
    EXPECT_LE(info.minimum, info.fallback) << info.name;
    EXPECT_GE(info.maximum, info.fallback) << info.name;
  }
}

}  // namespace
}  // namespace geoflow::simulator
