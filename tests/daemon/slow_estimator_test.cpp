#include <algorithm>
#include <cstddef>
#include <memory>
#include <numbers>
#include <stop_token>
#include <string>

#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/lock_step_runner.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/timesync/packet_queue.hpp"
#include "tests/support/data.hpp"

#include "simulated_walk.hpp"

/// A walk on a machine that has time for few of the camera's images.
namespace geoflow::daemon {
namespace {

/// An estimator behind the live pipeline's queue that takes one packet of every so many.
class SlowEstimator {
 public:
  SlowEstimator(const Run& run, const Config& config, std::size_t one_of)
      : queue_{static_cast<std::size_t>(config.pipeline.packet_queue),
               config.synchroniser.sample_capacity},
        core_{slam::Core::create(run.calibration, config.slam).value()},
        one_of_{one_of} {}

  void push(const SyncedPacket& packet) {
    queue_.push(packet);
    if (++pushed_ % one_of_ != 0) {
      return;
    }
    if (const auto taken = queue_.try_pop()) {
      const PoseEstimate estimate = core_->process(*taken);
      if (auto task = core_->take_mapping_task()) {
        core_->apply(slam::optimise(*task));
      }
      poses_.push_back({.t = estimate.t, .pose = estimate.T_odom_base});
      without_pose_ += has_pose(estimate.status) ? 0U : 1U;
    }
  }

  [[nodiscard]] const Trajectory& poses() const { return poses_; }
  [[nodiscard]] std::size_t without_pose() const { return without_pose_; }

 private:
  timesync::PacketQueue queue_;
  std::unique_ptr<slam::Core> core_;
  std::size_t one_of_;
  std::size_t pushed_ = 0;
  std::size_t without_pose_ = 0;
  Trajectory poses_;
};

TEST(SlowEstimator, ImuAndLegsCarryThePoseAcrossImagesThatThereIsNoTimeFor) {
  const tests::TemporaryDirectory directory;
  Config config;
  config.source.replay = tests::simulate_walk(directory.path(), "office", 3, 10);
  ASSERT_FALSE(config.source.replay.empty());
  const Trajectory truth = tests::read_poses(config.source.replay / "groundtruth_base.txt");
  // Ten, four and two images a second of thirty.
  for (const std::size_t one_of : {3U, 8U, 15U}) {
    auto run = open_run(config);
    ASSERT_TRUE(run) << run.error().message;
    SlowEstimator slow{*run, config, one_of};
    const auto push = [&](const SyncedPacket& packet, const PoseEstimate&) { slow.push(packet); };
    ASSERT_TRUE((LockStepRunner{*run, config, push}.run(std::stop_token{})));

    EXPECT_EQ(slow.without_pose(), 0U);
    EXPECT_GE(slow.poses().size(), 300 / one_of);
    const HostTime t0 = truth.front().t;
    double worst_m = 0;
    for (const StampedPose& pose : slow.poses()) {
      const double since_start_s = to_seconds(pose.t - t0);
      const SE3 expected =
          tests::pose_at(truth, to_seconds(slow.poses().front().t - t0)).pose.inverse() *
          tests::pose_at(truth, since_start_s).pose;
      const SE3 moved = slow.poses().front().pose.inverse() * pose.pose;
      worst_m = std::max(worst_m, (moved.translation() - expected.translation()).norm());
    }
    const double way_m =
        tests::motion_until(truth, to_seconds(truth.back().t - t0)).translation().norm();
    RecordProperty("worst_m_one_of_" + std::to_string(one_of), std::to_string(worst_m));
    // Half a degree of heading over the walk: what legs and IMU know by themselves.
    EXPECT_GT(way_m, 2);
    EXPECT_LT(worst_m, 0.5 * std::numbers::pi / 180 * way_m) << "one of " << one_of;
  }
}

}  // namespace
}  // namespace geoflow::daemon
