#include "legs/self_check.hpp"

#include <cstddef>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "tests/support/data.hpp"

#include "recordings.hpp"

namespace geoflow::slam {
namespace {

using testing::HasSubstr;

constexpr double kMass = 15.206;  // [kg], Unitree's MJCF of the Go2
constexpr const char* kSnapshots = "go2_real_standing_and_lying.csv";

void swap_legs(LegSample& sample, std::size_t a, std::size_t b) {
  for (std::size_t joint = 0; joint < kJointsPerLeg; ++joint) {
    std::swap(sample.joints[a * kJointsPerLeg + joint], sample.joints[b * kJointsPerLeg + joint]);
  }
}

std::string finding(const LegSample& sample) {
  const Result<StandingLoad> load = check_standing_load(kGo2Legs, sample, Vector3d::UnitZ(), kMass);
  return load ? "" : load.error().message;
}

TEST(SelfCheck, ARealGo2CarriesItsWeight) {
  GEOFLOW_DATA_OR_SKIP(folder, "go2-trot");
  const LegSample sample = tests::read_go2_snapshot(folder / kSnapshots, "standing");
  const Result<StandingLoad> load = check_standing_load(kGo2Legs, sample, Vector3d::UnitZ(), kMass);
  ASSERT_TRUE(load) << load.error().message;
  RecordProperty("weight_n", std::to_string(load->weight_n));
  // By the foot frames it is 147.3 N; the contact lies a foot's radius below.
  EXPECT_NEAR(load->weight_n, 147.7, 0.1);
  double at_foot_frames = 0;
  for (const Leg leg : {Leg::kFrontRight, Leg::kFrontLeft, Leg::kRearRight, Leg::kRearLeft}) {
    const LegJoints joints = joints_of(sample, leg);
    at_foot_frames +=
        ground_force(foot_jacobian(kGo2Legs, leg, joints.q_rad), joints.tau_nm).value().z();
  }
  EXPECT_NEAR(at_foot_frames, 147.3, 0.1);
}

TEST(SelfCheck, NamesWhatIsWrong) {
  GEOFLOW_DATA_OR_SKIP(folder, "go2-trot");
  const LegSample good = tests::read_go2_snapshot(folder / kSnapshots, "standing");
  LegSample sides = good;
  swap_legs(sides, 0, 1);
  swap_legs(sides, 2, 3);
  EXPECT_THAT(finding(sides), HasSubstr("left and right legs are swapped"));
  LegSample reversed = good;
  LegSample scaled = good;
  for (std::size_t joint = 0; joint < good.joints.size(); ++joint) {
    reversed.joints.at(joint).tau_nm *= -1;
    scaled.joints.at(joint).tau_nm *= 0.5;
  }
  EXPECT_THAT(finding(reversed), HasSubstr("sign is reversed"));
  EXPECT_THAT(finding(scaled), HasSubstr("scale is off"));
}

TEST(SelfCheck, SaysWhenItCannotTell) {
  LegSample silent;
  EXPECT_THAT(finding(silent), HasSubstr("not all four were heard"));
  silent.valid.fill(true);
  EXPECT_THAT(finding(silent), HasSubstr("no torques"));
}

}  // namespace
}  // namespace geoflow::slam
