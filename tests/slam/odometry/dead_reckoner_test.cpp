#include "odometry/dead_reckoner.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"

#include "odometry/simulated_walk.hpp"

/// Dead reckoning from frame to frame on simulated walks, against their exact truth.
namespace geoflow::slam {
namespace {

/// One simulated walk, and what a reckoner makes of it.
class Walked : public SimulatedWalk {
 public:
  using SimulatedWalk::SimulatedWalk;

  struct Account {
    int motions = 0;
    int by_legs = 0;
    double nees_rotation = 0;     ///< per degree of freedom, mean
    double nees_translation = 0;  ///< likewise
    double worst_m = 0;           ///< largest error of translation over a frame
  };

  [[nodiscard]] Account reckon(const Switches& switches, bool with_legs, bool with_twist) const {
    DeadReckoner reckoner{switches, calibration};
    Account account;
    for (double t_s = kFrameS; t_s < kWalkS - kFrameS; t_s += kFrameS) {
      SyncedPacket packet = samples_until(t_s);
      if (!with_legs) {
        packet.legs.clear();
      }
      if (!with_twist) {
        packet.body_velocity.clear();
      }
      const auto motion = reckoner.add(packet);
      if (motion) {
        const SE3 truth = T_world_cam(t_s - kFrameS).inverse() * T_world_cam(t_s);
        const Vector6d error = (motion->T_cam0_cam1.inverse() * truth).log();
        const Vector3d rotation = error.head<3>();
        const Vector3d translation = error.tail<3>();
        ++account.motions;
        account.by_legs += motion->legs ? 1 : 0;
        account.nees_rotation +=
            rotation.dot(motion->covariance.topLeftCorner<3, 3>().ldlt().solve(rotation)) / 3;
        account.nees_translation +=
            translation.dot(
                motion->covariance.bottomRightCorner<3, 3>().ldlt().solve(translation)) /
            3;
        account.worst_m = std::max(account.worst_m, translation.norm());
      }
    }
    account.nees_rotation /= std::max(1, account.motions);
    account.nees_translation /= std::max(1, account.motions);
    return account;
  }
};

TEST(DeadReckoner, KnowsEachStepOfAWalkByImuAndLegsAndHowWell) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const auto account = Walked{seed}.reckon({}, true, false);
    EXPECT_GT(account.motions, 500);
    EXPECT_GT(account.by_legs, 500);
    EXPECT_GT(account.nees_rotation, 0.2) << "seed " << seed;
    EXPECT_LT(account.nees_rotation, 2) << "seed " << seed;
    // A simulated foot slides less than what a real one is trusted with (LegNoise::settling).
    EXPECT_GT(account.nees_translation, 0.02) << "seed " << seed;
    EXPECT_LT(account.nees_translation, 2) << "seed " << seed;
    EXPECT_LT(account.worst_m, 0.002) << "seed " << seed;
  }
}

TEST(DeadReckoner, KnowsTheTurnByTheImuAlone) {
  const auto account = Walked{4}.reckon({.legs = false}, true, false);
  EXPECT_GT(account.motions, 500);
  EXPECT_EQ(account.by_legs, 0);
  EXPECT_GT(account.nees_rotation, 0.2);
  EXPECT_LT(account.nees_rotation, 2);
  EXPECT_LT(account.nees_translation, 0.1) << "what it does not know, it says it does not";
}

TEST(DeadReckoner, TakesTheRobotsOwnOdometryWhereItGivesNoJoints) {
  const auto account = Walked{5}.reckon({.imu = false}, false, true);
  EXPECT_GT(account.motions, 500);
  EXPECT_EQ(account.by_legs, account.motions);
  EXPECT_LT(account.nees_rotation, 1);
  EXPECT_LT(account.nees_translation, 1);
}

TEST(DeadReckoner, SaysNothingWithoutSensorsOrTheirPlace) {
  Walked walked{6};
  EXPECT_EQ(walked.reckon({.imu = false, .legs = false}, true, true).motions, 0);
  walked.calibration.T_base_cam.reset();
  walked.calibration.T_cam_imu.reset();
  EXPECT_EQ(walked.reckon({}, true, true).motions, 0);
}

}  // namespace
}  // namespace geoflow::slam
