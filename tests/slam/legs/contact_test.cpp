#include "legs/contact.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "tests/support/data.hpp"

namespace geoflow::slam {
namespace {

constexpr double kStep = 0.002;  // [s]

/// Kinematics that say nothing, so that a test sees the other sources alone.
FootEvidence blind() {
  FootEvidence foot;
  foot.v_covariance = 1e4 * Matrix3d::Identity();
  return foot;
}

using Evidence = std::array<std::optional<FootEvidence>, kLegCount>;

TEST(ForceRange, LevelIsFreeOfOffsetAndScale) {
  for (const double offset : {0.0, 45.0, -300.0}) {
    for (const double scale : {1.0, 8.0}) {
      ForceRange range;
      EXPECT_FALSE(range.level());
      for (int k = 0; k < 1000; ++k) {
        range.update(offset + scale * (k % 250 < 125 ? 0.0 : 60.0), kStep);
      }
      range.update(offset + scale * 15, kStep);
      ASSERT_TRUE(range.level());
      EXPECT_NEAR(*range.level(), 0.25, 0.05) << offset << " " << scale;
    }
  }
}

TEST(ForceRange, NoiseAloneIsNoLevel) {
  ForceRange range;
  for (int k = 0; k < 5000; ++k) {
    range.update(230 + 3 * std::sin(k), kStep);
  }
  EXPECT_FALSE(range.level());
}

TEST(Contact, SupportIsJudgedByTheWeightWhateverTheMass) {
  for (const double weight : {60.0, 150.0, 500.0}) {
    ContactEstimator contact;
    // A trot: diagonal pairs carry half each, the others show a tenth (their own inertia).
    for (int k = 0; k < 1500; ++k) {
      const bool first = k % 200 < 100;
      Evidence evidence{blind(), blind(), blind(), blind()};
      for (std::size_t leg = 0; leg < kLegCount; ++leg) {
        const bool stands = (leg == 0 || leg == 3) == first;
        evidence.at(leg)->support_n = weight * (stands ? 0.45 : 0.05);
      }
      const ContactEstimator::Feet& feet = contact.update(evidence, kStep);
      EXPECT_EQ(feet[0].stands, first) << k;
      EXPECT_EQ(feet[1].stands, !first) << k;
    }
  }
}

TEST(Contact, MovingFeetDoNotStandUnlessAllForcesSaySo) {
  ContactEstimator contact;
  const Evidence still{FootEvidence{}, FootEvidence{}, FootEvidence{}, FootEvidence{}};
  contact.update(still, kStep);
  EXPECT_TRUE(contact.feet()[2].stands);
  Evidence moving = still;
  moving[2]->v_odom_mps = {0.8, 0, 0};
  contact.update(moving, kStep);
  EXPECT_FALSE(contact.feet()[2].stands);
  EXPECT_TRUE(contact.feet()[1].stands);
}

/// A sensor that falls late (60 to 80 ms on a Go2) still says that a foot stands whose joints carry
/// nothing any more: it may, but it holds nothing.
TEST(Contact, AFootThatEitherSourceSaysIsUnloadedHasNoGrip) {
  ContactEstimator contact;
  const auto all = [](double force, double support_n) {
    FootEvidence foot = blind();
    foot.force = force;
    foot.support_n = support_n;
    return Evidence{foot, foot, foot, foot};
  };
  for (int k = 0; k < 1000; ++k) {
    contact.update(all(k % 250 < 125 ? 0 : 60, 40), kStep);
  }
  EXPECT_GT(contact.feet()[0].grip, 0.8);
  EXPECT_TRUE(contact.feet()[0].stands);
  Evidence lifting = all(60, 40);
  lifting[0]->support_n = 5;
  contact.update(lifting, kStep);
  EXPECT_TRUE(contact.feet()[0].stands);
  EXPECT_LT(contact.feet()[0].grip, 0.2);
  EXPECT_GT(contact.feet()[1].grip, 0.8);
}

TEST(Contact, AFootIsTakenToHaveGripWhereNothingTells) {
  ContactEstimator contact;
  contact.update({FootEvidence{}, FootEvidence{}, FootEvidence{}, FootEvidence{}}, kStep);
  EXPECT_EQ(contact.feet()[0].grip, 1);
}

TEST(Contact, ALegThatIsNotHeardDoesNotStand) {
  ContactEstimator contact;
  Evidence evidence{FootEvidence{}, FootEvidence{}, FootEvidence{}, FootEvidence{}};
  contact.update(evidence, kStep);
  contact.update(evidence, kStep);
  EXPECT_DOUBLE_EQ(contact.feet()[3].stance_s, kStep);
  evidence[3].reset();
  contact.update(evidence, kStep);
  EXPECT_TRUE(contact.feet()[3].stands);  // a lost sample is no step
  for (int k = 0; k < 25; ++k) {
    contact.update(evidence, kStep);
  }
  EXPECT_FALSE(contact.feet()[3].stands);
  EXPECT_EQ(contact.feet()[3].stance_s, 0);
}

/// Real foot sensors: offset and level differ from run to run (facts measured on the recordings:
/// step period 0.67 s, share of stance 0.50 to 0.54 on a hard floor).
TEST(Contact, RealFootSensorsGiveARealGait) {
  GEOFLOW_DATA_OR_SKIP(folder, "foot-contact");
  for (const char* name : {"GO1_normal_surface.csv", "GO1_slippery_surface.csv"}) {
    std::ifstream file{folder / name};
    ContactEstimator contact;
    std::vector<int> touchdowns;  // samples, of stances that are no bounce
    std::vector<int> liftoffs;
    int sample = 0;
    int changed = 0;
    bool stood = false;
    for (std::string line; std::getline(file, line); ++sample) {
      Evidence evidence{blind(), std::nullopt, std::nullopt, std::nullopt};
      evidence[0]->force = std::stod(line);
      const bool stands = contact.update(evidence, kStep)[0].stands;
      constexpr int kBounce = 50;  // 0.1 s
      if (stood && !stands && sample - changed > kBounce) {
        touchdowns.push_back(changed);
        liftoffs.push_back(sample);
      }
      changed = stands == stood ? changed : sample;
      stood = stands;
    }
    ASSERT_GT(touchdowns.size(), 5) << name;
    // The first stance is the standing before the walk.
    const double steps = static_cast<double>(touchdowns.size()) - 2;
    const double period = (touchdowns.back() - touchdowns[1]) * kStep / steps;
    double stance = 0;
    for (std::size_t step = 1; step + 1 < touchdowns.size(); ++step) {
      stance += (liftoffs[step] - touchdowns[step]) * kStep;
    }
    const double duty = stance / (steps * period);
    RecordProperty(std::string{name} + "_duty", std::to_string(duty));
    RecordProperty(std::string{name} + "_period_s", std::to_string(period));
    EXPECT_NEAR(duty, 0.52, 0.07) << name;
    EXPECT_NEAR(period, 0.67, 0.07) << name;
  }
}

}  // namespace
}  // namespace geoflow::slam
