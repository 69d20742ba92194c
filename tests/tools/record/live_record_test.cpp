#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/lock_step_runner.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/sources.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/timesync/synchroniser.hpp"
#include "tests/support/data.hpp"

#include "pipeline/estimation.hpp"
#include "record/emulated_camera.hpp"
#include "record/live_recorder.hpp"
#include "record/sample_queue.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::tools {
namespace {

constexpr int kFrames = 20;
// A run in memory takes all that its camera can give; what is lost then is lost before it.
constexpr QueueLimits kAll{.images = 100'000, .samples = 1'000'000};

/// The estimator on live samples, in lock step: each sample is worked on before the next one comes.
class LiveEstimator final : public daemon::SampleReceiver {
 public:
  void begin(daemon::Run& run, const daemon::Config& config) {
    run_ = &run;
    synchroniser_ = std::make_unique<timesync::Synchroniser>(config.synchroniser,
                                                             daemon::synchroniser_streams(run));
  }
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    synchroniser_->push_color(frame);
    work(frame.t_arrival);
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    synchroniser_->push_depth(frame);
    work(frame.t_arrival);
  }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    synchroniser_->push_imu(sample);
    work(sample.t_arrival);
  }
  void on_legs(const Arrival<LegClock, LegSample>& /*sample*/) override {}
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}

  void finish() {
    while (const auto packet = synchroniser_->flush()) {
      estimate(*packet);
    }
  }
  [[nodiscard]] const std::vector<PoseEstimate>& estimates() const { return estimates_; }

 private:
  void work(HostTime now) {
    while (const auto packet = synchroniser_->pop(now)) {
      estimate(*packet);
    }
  }
  void estimate(const SyncedPacket& packet) {
    estimates_.push_back(daemon::process_packet(*run_, packet));
    if (const auto task = run_->core->take_mapping_task()) {
      run_->core->apply(slam::optimise(*task, &run_->statistics->mapping));
    }
  }

  daemon::Run* run_ = nullptr;
  std::unique_ptr<timesync::Synchroniser> synchroniser_;
  std::vector<PoseEstimate> estimates_;
};

// The first frames may go before both streams have been asked for.
constexpr std::uint64_t kEnoughImages = 2 * kFrames - 6;

/// Goes on until nearly all images have come.
class UntilEnough {
 public:
  bool operator()(const LiveCounts& counts) const {
    return counts.written[0] + counts.written[1] < kEnoughImages && HostClock::now() < limit_;
  }

 private:
  HostTime limit_ = HostClock::now() + std::chrono::minutes{2};
};

class LiveRecord : public testing::Test {
 protected:
  void SetUp() override {
    log::set_level(log::Level::kError);  // the world ends before the camera is told to
    geoflow::tests::write_synthetic_recording(
        folder_.path() / "world",
        {.frames = kFrames, .width = 640, .height = 480, .focal_px = 520});
  }
  void TearDown() override { log::set_level(log::Level::kInfo); }
  [[nodiscard]] Result<std::unique_ptr<drivers::BagWriter>> writer(daemon::Sources& sources) const {
    const daemon::Ports ports = sources.ports();
    return drivers::BagWriter::create({.directory = bag_,
                                       .camera_stamps = ports.camera->stamps(),
                                       .imu_stamps = ports.imu->stamps()},
                                      sources.calibration);
  }

  geoflow::tests::TemporaryDirectory folder_;
  std::filesystem::path bag_ = folder_.path() / "bag";
};

TEST_F(LiveRecord, IsReplayedToThePosesOfTheLiveRunBitForBit) {
  const daemon::Config config;
  LiveEstimator estimator;
  auto camera = tests::open_emulated_camera(folder_.path() / "world");
  ASSERT_TRUE(camera) << camera.error().message;
  daemon::Sources sources;
  sources.calibration = (*camera)->calibration();
  sources.camera = std::make_unique<tests::ForkedCamera>(std::move(*camera), estimator);
  auto run = daemon::make_run(config, std::move(sources));
  ASSERT_TRUE(run) << run.error().message;
  estimator.begin(*run, config);
  auto bag = writer(*run);
  ASSERT_TRUE(bag) << bag.error().message;
  const auto counts = record_live(*run, **bag, kAll, UntilEnough{});
  ASSERT_TRUE(counts) << counts.error().message;
  ASSERT_TRUE((*bag)->close());
  estimator.finish();
  EXPECT_EQ(counts->dropped, 0U);
  ASSERT_GE(counts->written[0] + counts->written[1], kEnoughImages);
  EXPECT_GT(counts->written[2], 0U);

  daemon::Config replayed_config;
  replayed_config.source.replay = bag_;
  replayed_config.source.realtime = false;
  auto replayed = daemon::open_run(replayed_config);
  ASSERT_TRUE(replayed) << replayed.error().message;
  std::vector<PoseEstimate> estimates;
  daemon::LockStepRunner runner{*replayed, replayed_config,
                                [&](const SyncedPacket& /*packet*/, const PoseEstimate& estimate) {
                                  estimates.push_back(estimate);
                                }};
  ASSERT_TRUE(runner.run({}));
  ASSERT_EQ(estimates.size(), estimator.estimates().size());
  ASSERT_FALSE(estimates.empty());
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const PoseEstimate& live = estimator.estimates()[i];
    EXPECT_EQ(estimates[i].t, live.t);
    EXPECT_EQ(estimates[i].status, live.status) << "frame " << i;
    EXPECT_EQ(estimates[i].T_odom_base.translation(), live.T_odom_base.translation())
        << "frame " << i;
    EXPECT_EQ(estimates[i].T_odom_base.rotation().coeffs(), live.T_odom_base.rotation().coeffs())
        << "frame " << i;
  }
  // And it did move: 4 px a frame before a wall at 1.3 m, seen by 520 px.
  const double way_m =
      (estimates.back().T_odom_base.translation() - estimates.front().T_odom_base.translation())
          .norm();
  EXPECT_NEAR(way_m, 0.01 * static_cast<double>(estimates.size() - 1), 0.02);
}

TEST_F(LiveRecord, EndsWithASourceThatEnds) {
  auto streams = drivers::RecordedStreams::open({.path = folder_.path() / "world"});
  ASSERT_TRUE(streams) << streams.error().message;
  daemon::Sources sources{.streams = std::move(*streams)};
  sources.calibration = sources.streams->calibration();
  auto bag = drivers::BagWriter::create({.directory = bag_}, sources.calibration);
  ASSERT_TRUE(bag) << bag.error().message;
  const auto counts =
      record_live(sources, **bag, kAll, [](const LiveCounts& /*so_far*/) { return true; });
  ASSERT_TRUE(counts) << counts.error().message;
  EXPECT_EQ(counts->written[0], kFrames);
  EXPECT_EQ(counts->written[1], kFrames);
}

}  // namespace
}  // namespace geoflow::tools
