#include "geoflow/daemon/pipeline.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <stop_token>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/lock_step_runner.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "tests/support/data.hpp"

#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

class PipelineTest : public testing::Test {
 protected:
  void SetUp() override {
    tests::write_synthetic_recording(directory_.path(), recording_);
    config_.source.replay = directory_.path();
  }

  std::vector<PoseEstimate> run_lock_step() {
    auto run = open_run(config_);
    EXPECT_TRUE(run) << run.error().message;
    std::vector<PoseEstimate> estimates;
    const auto keep = [&](const SyncedPacket&, const PoseEstimate& e) { estimates.push_back(e); };
    EXPECT_TRUE((LockStepRunner{*run, config_, keep}.run(std::stop_token{})));
    return estimates;
  }

  tests::TemporaryDirectory directory_;
  tests::SyntheticRecording recording_;
  Config config_;
};

TEST_F(PipelineTest, LockStepTracksEveryFrameAndTwoRunsAreEqualToTheBit) {
  const auto first = run_lock_step();
  const auto second = run_lock_step();
  ASSERT_EQ(first.size(), static_cast<std::size_t>(recording_.frames));
  ASSERT_EQ(second.size(), first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].t, second[i].t);
    EXPECT_TRUE(has_pose(first[i].status)) << i;
    EXPECT_TRUE(
        (first[i].T_odom_base.matrix().array() == second[i].T_odom_base.matrix().array()).all())
        << i;
    EXPECT_TRUE((first[i].covariance.array() == second[i].covariance.array()).all()) << i;
  }
  const double travelled_m = recording_.step_m() * (recording_.frames - 1);
  const Vector3d end_m = first.back().T_odom_base.translation();
  EXPECT_NEAR(end_m.x(), travelled_m, 0.02 * travelled_m);
  EXPECT_LT(end_m.tail<2>().norm(), 0.02 * travelled_m);
}

TEST_F(PipelineTest, LockStepStopsWhenAsked) {
  auto run = open_run(config_).value();
  std::stop_source stop;
  std::size_t frames = 0;
  const auto stop_at_five = [&](const SyncedPacket&, const PoseEstimate&) {
    if (++frames == 5) {
      stop.request_stop();
    }
  };
  ASSERT_TRUE((LockStepRunner{run, config_, stop_at_five}.run(stop.get_token())));
  EXPECT_EQ(frames, 5U);
}

TEST_F(PipelineTest, LockStepCountsWhatCannotBeRead) {
  std::filesystem::resize_file(directory_.path() / "rgb" / "0003.png", 40);
  auto run = open_run(config_).value();
  std::size_t frames = 0;
  ASSERT_TRUE((
      LockStepRunner{run, config_, [&](const SyncedPacket&, const PoseEstimate&) { ++frames; }}.run(
          std::stop_token{})));
  EXPECT_EQ(run.statistics->counters.rejected.load(), 1U);
  EXPECT_EQ(frames, static_cast<std::size_t>(recording_.frames) - 1);
}

TEST_F(PipelineTest, LiveAccountsForEveryFrameAndEndsOnce) {
  auto run = open_run(config_).value();
  std::promise<void> ended;
  std::vector<PoseEstimate> estimates;
  auto pipeline = Pipeline::start(
      run, config_,
      {.on_estimate = [&](const SyncedPacket&, const PoseEstimate& e) { estimates.push_back(e); },
       .on_end = [&] { ended.set_value(); }});
  ASSERT_TRUE(pipeline) << pipeline.error().message;
  ASSERT_EQ(ended.get_future().wait_for(std::chrono::seconds{120}), std::future_status::ready);
  (*pipeline)->stop();
  const RunCounters& counters = run.statistics->counters;
  const auto frames = static_cast<std::uint64_t>(recording_.frames);
  EXPECT_EQ(counters.color_frames.load(), frames);
  EXPECT_EQ(estimates.size(), run.statistics->frames());
  // A loaded machine may drop frames; each is counted, and the newest is never one of them.
  EXPECT_EQ(estimates.size() + counters.packets_dropped.load() + counters.color_dropped.load(),
            frames);
  ASSERT_FALSE(estimates.empty());
  EXPECT_EQ(estimates.back().sequence + 1, counters.packets.load());
  EXPECT_EQ(run.synchroniser.packets, counters.packets.load());
  for (std::size_t i = 1; i < estimates.size(); ++i) {
    EXPECT_LT(estimates[i - 1].t, estimates[i].t);
  }
  EXPECT_EQ(run.statistics->delivery.summary().count, estimates.size());
}

TEST_F(PipelineTest, LiveStopsAtOnce) {
  auto run = open_run(config_).value();
  std::promise<void> first;
  bool seen = false;
  auto pipeline =
      Pipeline::start(run, config_,
                      {.on_estimate =
                           [&](const SyncedPacket&, const PoseEstimate&) {
                             if (!std::exchange(seen, true)) {
                               first.set_value();
                             }
                           },
                       .on_end = [] { ADD_FAILURE() << "a stopped pipeline has not ended"; }});
  ASSERT_TRUE(pipeline);
  ASSERT_EQ(first.get_future().wait_for(std::chrono::seconds{60}), std::future_status::ready);
  (*pipeline)->stop();
  const std::uint64_t frames = run.statistics->frames();
  EXPECT_LT(frames, static_cast<std::uint64_t>(recording_.frames));
  (*pipeline)->stop();
  EXPECT_EQ(run.statistics->frames(), frames);
}

TEST_F(PipelineTest, OpeningWhatIsNotThereIsAnError) {
  config_.source.replay = directory_.path() / "nothing";
  EXPECT_FALSE(open_run(config_));
  config_.source.replay.clear();
  EXPECT_EQ(open_run(config_).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace geoflow::daemon
