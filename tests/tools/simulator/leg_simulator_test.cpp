#include "geoflow/tools/simulator/leg_simulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/support_forces.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"
#include "tests/support/data.hpp"

#include "walk_fixture.hpp"

namespace geoflow::simulator {
namespace {

using tests::walk_for;

/// 0.061 s on slippery floor, 0.080 s on hard floor.
constexpr double kRealRiseS = 0.0708;
constexpr double kRealRiseSpreadS = 0.010;

constexpr double kForceStepS = 0.002;  // of the real recordings and of simulated legs

/// Where the counts come to `level` at first from sample `from` on, between samples.
double crossing(std::span<const double> counts, std::size_t from, double level) {
  std::size_t i = from;
  while (i < counts.size() && counts[i] <= level) {
    ++i;
  }
  return i == from || i == counts.size()
             ? static_cast<double>(i)
             : static_cast<double>(i) - (counts[i] - level) / (counts[i] - counts[i - 1]);
}

/// The median of the times in which a foot force sensor rises from a tenth to nine tenths of the
/// way from swing to the first peak of a stance. A stance begins where counts pass 0.3 of their
/// range and lasts 0.15 s at least; its first peak is the highest one within 0.12 s, and its swing
/// the lowest one within 0.1 s before.
double median_rise_s(std::span<const double> counts) {
  constexpr std::size_t kPeak = 60;
  constexpr std::size_t kBefore = 50;
  constexpr std::size_t kShortest = 75;
  std::vector<double> sorted(counts.begin(), counts.end());
  std::ranges::sort(sorted);
  const double low = sorted.at(sorted.size() / 20);
  const double begin = low + 0.3 * (sorted.at(sorted.size() * 19 / 20) - low);
  std::vector<double> rises;
  for (std::size_t i = kBefore; i + kShortest < counts.size(); ++i) {
    const auto stance = counts.subspan(i, kShortest);
    if (counts[i - 1] > begin || *std::ranges::min_element(stance) <= begin) {
      continue;
    }
    const auto before = counts.subspan(i - kBefore, kBefore);
    const auto lowest = std::ranges::min_element(before);
    const double peak = *std::ranges::max_element(stance.first(kPeak));
    const auto from = i - kBefore + static_cast<std::size_t>(lowest - before.begin());
    rises.push_back(crossing(counts, from, *lowest + 0.9 * (peak - *lowest)) -
                    crossing(counts, from, *lowest + 0.1 * (peak - *lowest)));
  }
  EXPECT_GE(rises.size(), 6U);
  std::ranges::sort(rises);
  return rises.empty() ? 0 : kForceStepS * rises.at(rises.size() / 2);
}

TEST(LegSimulator, TorquesHoldTheSupportForceExactly) {
  const Walk walk = walk_for(12);
  const LegSimulator legs{walk, 1, exact_legs()};
  for (std::size_t i = 0; i < legs.size(); i += 7) {
    const LegReading reading = legs.reading(i);
    const BodyState body = walk.body().at(reading.t_s);
    const Matrix3d R_world_base = body.T_world_base.rotation_matrix();
    const Vector3d up_in_base = R_world_base.transpose() * Vector3d::UnitZ();
    Vector3d sum = Vector3d::Zero();
    for (const Leg leg : kAllLegs) {
      const LegJoints joints = joints_of(reading.sample, leg);
      const Matrix3d J =
          foot_contact(kGo2Legs, leg, joints.q_rad, up_in_base, kGo2Legs.foot_radius_m).jacobian;
      const auto force = ground_force(J, joints.tau_nm);
      ASSERT_TRUE(force.has_value());
      sum += R_world_base * *force;
      EXPECT_LT(
          (R_world_base * *force - reading.truth.force_world.at(static_cast<std::size_t>(leg)))
              .norm(),
          1e-9);
    }
    EXPECT_LT((sum - required_force(body)).norm(), 1e-9);
  }
}

TEST(LegSimulator, AStandingGo2WeighsWhatARealOneDoes) {
  const Walk walk = walk_for(4);
  LegSensorOptions options = exact_legs();
  options.leg_mass_scale = 1;
  const LegSimulator legs{walk, 1, options};
  const LegReading reading = legs.reading(500);
  double weight = 0;
  std::array<double, kLegCount> by_foot{};
  for (const Leg leg : kAllLegs) {
    const LegJoints joints = joints_of(reading.sample, leg);
    const auto force = ground_force(foot_jacobian(kGo2Legs, leg, joints.q_rad), joints.tau_nm);
    ASSERT_TRUE(force.has_value());
    by_foot.at(static_cast<std::size_t>(leg)) = force->z();
    weight += force->z();
  }
  // A real one: 147.3 N, of which front right, front left, rear right, rear
  // left 42.1, 43.6, 31.2, 30.5. To a newton: a motor's smallest step of torque, at each of the
  // four knees.
  EXPECT_NEAR(weight, 147.3, 1);
  EXPECT_NEAR(by_foot[0] + by_foot[1], 85.7, 2);
  EXPECT_NEAR(by_foot[2] + by_foot[3], 61.7, 2);
}

TEST(LegSimulator, ForcesPushAndStayWithinFriction) {
  std::vector<double> ratios;
  int pulling = 0;
  int stances = 0;
  for (const bool pronounced : {false, true}) {
    const Walk walk = walk_for(20, pronounced ? with_pronounced_trot({}) : WalkOptions{});
    const LegSimulator legs{walk, 1, exact_legs()};
    for (std::size_t i = 0; i < legs.size(); i += 3) {
      const LegTruth truth = legs.truth(static_cast<double>(i) / 500);
      for (std::size_t l = 0; l < kLegCount; ++l) {
        const Vector3d& force = truth.force_world.at(l);
        if (!truth.contact.at(l)) {
          EXPECT_EQ(force.norm(), 0);
          continue;
        }
        ++stances;
        pulling += static_cast<int>(force.z() < -1e-9);
        if (force.z() > 10 && !pronounced) {
          ratios.push_back(force.head<2>().norm() / force.z());
        }
      }
    }
  }
  std::ranges::sort(ratios);
  const double usual = ratios.at(ratios.size() * 95 / 100);
  RecordProperty("friction_ratio_p95", std::to_string(usual));
  EXPECT_LT(usual, 0.6);  // rubber on a floor holds
  EXPECT_LT(pulling, stances / 1000);
}

TEST(LegSimulator, NoiseIsThatOfARealGo2) {
  WalkOptions standing;
  standing.speed_mps = 0;
  const Walk walk = walk_for(10, standing);
  const LegSimulator legs{walk, 3, {}};
  std::array<double, kJointsPerLeg> squares{};
  for (std::size_t i = 0; i < legs.size(); ++i) {
    for (const Leg leg : kAllLegs) {
      const LegJoints joints = joints_of(legs.reading(i).sample, leg);
      for (std::size_t j = 0; j < kJointsPerLeg; ++j) {
        squares.at(j) += std::pow(joints.dq_radps[static_cast<Eigen::Index>(j)], 2);
      }
    }
  }
  const auto rms = [&](std::size_t j) {
    return std::sqrt(squares.at(j) / static_cast<double>(kLegCount * legs.size()));
  };
  EXPECT_NEAR(rms(0), 0.029, 0.002);
  EXPECT_NEAR(rms(1), 0.047, 0.002);
  EXPECT_NEAR(rms(2), 0.013, 0.001);
}

TEST(LegSimulator, FootForceLagsAndHasAnOffsetByFoot) {
  const Walk walk = walk_for(15);
  LegSensorOptions options;
  options.force_noise_counts = 0;
  const LegSimulator legs{walk, 5, options};
  // The step response: 10 to 90 percent of a plateau takes the rise time by definition of the lag,
  // so what is seen after landing is later than the true force.
  std::array<double, kLegCount> lowest{};
  lowest.fill(1e9);
  double lag_product = 0;
  double product = 0;
  for (std::size_t i = 2500; i + 20 < legs.size(); ++i) {
    const LegReading now = legs.reading(i);
    for (std::size_t l = 0; l < kLegCount; ++l) {
      const auto counts = static_cast<double>(now.sample.foot_force.at(l));
      lowest.at(l) = std::min(lowest.at(l), counts);
      const double later = static_cast<double>(legs.reading(i + 12).sample.foot_force.at(l));
      product += now.truth.force_world.at(l).z() * counts;
      lag_product += now.truth.force_world.at(l).z() * later;
    }
  }
  EXPECT_GT(lag_product, product);
  for (const double counts : lowest) {
    EXPECT_GE(counts, 9);  // a fifth of the greatest offset
    EXPECT_LE(counts, 60);
  }
  EXPECT_GT(*std::ranges::max_element(lowest) - *std::ranges::min_element(lowest), 1);
}

TEST(LegSimulator, FootForceRisesAsOnRealFeet) {
  const Walk walk = walk_for(20);
  const LegSimulator legs{walk, 1, {}};
  for (std::size_t l = 0; l < kLegCount; ++l) {
    std::vector<double> counts;
    for (std::size_t i = 1750; i < legs.size(); ++i) {
      counts.push_back(static_cast<double>(legs.reading(i).sample.foot_force.at(l)));
    }
    const double rise_s = median_rise_s(counts);
    RecordProperty("rise_s_" + std::to_string(l), std::to_string(rise_s));
    EXPECT_NEAR(rise_s, kRealRiseS, kRealRiseSpreadS) << "leg " << l;
  }
}

/// The bounds that the simulated feet are held to, by the same estimator on a real Go1's feet on
/// hard and on slippery floor.
TEST(LegSimulator, RealFeetRiseWithinTheSameBounds) {
  GEOFLOW_DATA_OR_SKIP(folder, "foot-contact");
  for (const char* name : {"GO1_normal_surface.csv", "GO1_slippery_surface.csv"}) {
    std::ifstream file{folder / name};
    std::vector<double> counts;
    for (std::string line; std::getline(file, line);) {
      counts.push_back(std::stod(line));
    }
    const double rise_s = median_rise_s(counts);
    RecordProperty(std::string{name} + "_rise_s", std::to_string(rise_s));
    EXPECT_NEAR(rise_s, kRealRiseS, kRealRiseSpreadS) << name;
  }
}

TEST(LegSimulator, IsDeterministicAndOneKnobLeavesOtherNoiseAlone) {
  const Walk walk = walk_for(6);
  LegSensorOptions louder;
  louder.torque_noise_nm = 1;
  const LegReading one = LegSimulator{walk, 4, {}}.reading(2111);
  const LegReading again = LegSimulator{walk, 4, {}}.reading(2111);
  const LegReading other = LegSimulator{walk, 4, louder}.reading(2111);
  for (std::size_t joint = 0; joint < one.sample.joints.size(); ++joint) {
    EXPECT_EQ(one.sample.joints.at(joint).q_rad, again.sample.joints.at(joint).q_rad);
    EXPECT_EQ(one.sample.joints.at(joint).dq_radps, other.sample.joints.at(joint).dq_radps);
    EXPECT_EQ(one.sample.joints.at(joint).tau_nm, again.sample.joints.at(joint).tau_nm);
    EXPECT_NE(one.sample.joints.at(joint).tau_nm, other.sample.joints.at(joint).tau_nm);
  }
  EXPECT_EQ(one.sample.foot_force, other.sample.foot_force);
}

TEST(LegSimulator, ItsKnobsHoldTheirDefaults) {
  for (const Knob<LegSensorOptions>& knob : leg_knobs()) {
    const KnobInfo info = describe(knob);
    EXPECT_TRUE(info.name.starts_with("legs."));
    EXPECT_LE(info.minimum, info.fallback) << info.name;
    EXPECT_GE(info.maximum, info.fallback) << info.name;
  }
}

}  // namespace
}  // namespace geoflow::simulator
