#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "legs/leg_config.hpp"
#include "legs/leg_odometry.hpp"
#include "odometry/simulated_walk.hpp"

/// Whether IMU and legs alone find a walk's length: a share that is wrong in every walk is an error
/// of the method, which no loop and no average takes away.
namespace geoflow::slam {
namespace {

/// The samples in (after, until], with one on either side.
template <typename Sample>
std::span<const Timed<Sample>> around(const std::vector<Timed<Sample>>& all, HostTime after,
                                      HostTime until) {
  auto first = std::ranges::upper_bound(all, after, {}, &Timed<Sample>::t);
  auto last = std::ranges::upper_bound(all, until, {}, &Timed<Sample>::t);
  first -= first != all.begin() ? 1 : 0;
  last += last != all.end() ? 1 : 0;
  return {first, last};
}

/// Estimated length over true length less 1, of half seconds once it walks.
double scale_error(const SimulatedWalk& walk) {
  constexpr double kStretchS = 0.5;
  constexpr double kWalksFromS = 3;
  constexpr double kLeastM = 0.05;
  LegOdometry odometry{leg_config_of(walk.calibration)};
  double estimated = 0;
  double truly = 0;
  std::optional<LegEstimate> begin;
  double begin_s = 0;
  for (double t_s = kFrameS; t_s < kWalkS - kFrameS; t_s += kFrameS) {
    const HostTime before = walk_time(t_s - kFrameS);
    const HostTime now = walk_time(t_s);
    const auto estimate = odometry.add({.imu = around(walk.imu, before, now),
                                        .legs = around(walk.legs, before, now),
                                        .body_velocity = {}},
                                       now);
    if (!estimate || t_s < kWalksFromS || (begin && t_s - begin_s < kStretchS)) {
      continue;
    }
    if (begin) {
      const Vector3d found = (begin->T_start_base.inverse() * estimate->T_start_base).translation();
      const Vector3d truth =
          (walk.T_world_base(begin_s).inverse() * walk.T_world_base(t_s)).translation();
      const double length = truth.head<2>().norm();
      if (length > kLeastM) {
        estimated += found.head<2>().dot(truth.head<2>()) / length;
        truly += length;
      }
    }
    begin = estimate;
    begin_s = t_s;
  }
  return estimated / truly - 1;
}

/// A foot that lifts is heard as standing for a while, as its sensor falls late; taken at its word,
/// it shortens each step.
TEST(LegScale, IsRightInTheMeanOfManyWalks) {
  constexpr int kWalks = 10;
  double sum = 0;
  for (std::uint64_t seed = 1; seed <= kWalks; ++seed) {
    const double error = scale_error(SimulatedWalk{seed});
    EXPECT_LT(std::abs(error), 0.003) << "seed " << seed;
    sum += error;
  }
  RecordProperty("mean_percent", std::to_string(100 * sum / kWalks));
  EXPECT_LT(std::abs(sum / kWalks), 0.001);
}

}  // namespace
}  // namespace geoflow::slam
