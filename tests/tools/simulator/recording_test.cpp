#include "geoflow/drivers/recording.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/simulation.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "simulate/settings.hpp"
#include "simulate/writer.hpp"
#include "simulator/recording/src/arrivals.hpp"
#include "simulator/recording/src/body_odometry.hpp"

namespace geoflow::tools {
namespace {

using simulator::Simulation;
using simulator::SimulationOptions;
using testing::HasSubstr;

namespace fs = std::filesystem;

/// A second of a small camera's images: enough for every path, soon rendered.
SimulationOptions small() {
  SimulationOptions options{.scene = "office", .seed = 3, .duration_s = 1};
  options.camera.width = 160;
  options.camera.height = 120;
  options.recording.frame_rate_hz = 10;
  return options;
}

Result<bool> write(const SimulationOptions& options, const fs::path& directory, bool tum = false) {
  auto simulation = Simulation::create(options);
  if (!simulation) {
    return tl::unexpected{simulation.error()};
  }
  return write_simulation(**simulation,
                          {.directory = directory, .tum = tum, .parameters = to_json(options)},
                          [](std::size_t /*done*/, std::size_t /*total*/) { return true; });
}

std::string content(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream{file, std::ios::binary}.rdbuf();
  return text.str();
}

/// What a recording delivers, with the arrivals of each stream.
class Recorder final : public CameraSink, public ImuSink, public LegSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override { colors.push_back(frame); }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override { depths.push_back(frame); }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { imus.push_back(sample); }
  void on_legs(const Arrival<LegClock, LegSample>& sample) override { legs.push_back(sample); }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override {
    velocities.push_back(sample);
  }

  std::vector<Arrival<CameraClock, ColorFrame>> colors;
  std::vector<Arrival<CameraClock, DepthFrame>> depths;
  std::vector<Arrival<ImuClock, ImuSample>> imus;
  std::vector<Arrival<LegClock, LegSample>> legs;
  std::vector<Arrival<LegClock, BodyVelocitySample>> velocities;
};

TEST(Arrivals, HaveTheirLatencyAndNeverOvertake) {
  simulator::PlannedStream stream{.kind = simulator::SampleKind::kImu,
                                  .delay = {.latency_s = 0.01, .jitter_s = 0.004}};
  constexpr std::size_t kCount = 20'000;
  for (std::size_t i = 0; i < kCount; ++i) {
    stream.measured.emplace_back(std::chrono::milliseconds{100 * i});  // too far apart to meet
  }
  std::vector<simulator::PlannedArrival> arrivals;
  plan_arrivals(stream, simulator::RandomStream{1, "test"}, arrivals);
  ASSERT_EQ(arrivals.size(), kCount);
  double sum_s = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const double delay_s = to_seconds(arrivals[i].t - stream.measured[i]);
    EXPECT_GE(delay_s, 0.01);
    sum_s += delay_s;
  }
  // The mean of 20000 exponential delays has a standard deviation of 0.004 / sqrt(20000).
  EXPECT_NEAR(sum_s / kCount, 0.014, 4 * 0.004 / std::sqrt(kCount));
  for (std::size_t i = 0; i < kCount; ++i) {
    stream.measured[i] = HostTime{std::chrono::microseconds{100 * i}};
  }
  arrivals.clear();
  plan_arrivals(stream, simulator::RandomStream{1, "test"}, arrivals);
  EXPECT_TRUE(std::ranges::is_sorted(arrivals));
}

TEST(BodyOdometry, HasTheNoiseThatWasAskedFor) {
  const simulator::RecordingOptions options;
  const simulator::BodyOdometry odometry{5, options};
  simulator::BodyState body;
  body.T_world_base = SE3{so3::exp({0, 0, 1}), Vector3d::Zero()};
  body.v_world_base = body.T_world_base.rotation() * Vector3d{1, 0, 0};
  constexpr int kSamples = 20'000;
  Vector3d mean = Vector3d::Zero();
  double squares = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Vector3d v_base = odometry.sample(static_cast<std::size_t>(i), body).v_base_mps;
    mean += v_base / kSamples;
    squares += v_base.y() * v_base.y() / kSamples;
  }
  EXPECT_NEAR(mean.x(), 1, 4 * options.odometry_scale_error);
  EXPECT_NE(mean.x(), 1);
  EXPECT_NEAR(std::sqrt(squares), options.odometry_noise_mps, 0.02 * options.odometry_noise_mps);
}

TEST(Knobs, AreSetByNameAndNamesAreUnique) {
  std::map<std::string_view, int> seen;
  for (const simulator::KnobInfo& knob : all_knobs()) {
    EXPECT_EQ(++seen[knob.name], 1) << knob.name;
    EXPECT_LE(knob.minimum, knob.fallback) << knob.name;
    EXPECT_GE(knob.maximum, knob.fallback) << knob.name;
    EXPECT_FALSE(knob.summary.empty()) << knob.name;
    SimulationOptions options;
    EXPECT_TRUE(set_knob(options, fmt::format("{}={}", knob.name, knob.maximum))) << knob.name;
    EXPECT_EQ(to_json(options)["knobs"][std::string{knob.name}], knob.maximum) << knob.name;
  }
}

TEST(Knobs, AWrongOneNamesTheNearest) {
  SimulationOptions options;
  const auto message = [&](std::string_view assignment) {
    const auto set = set_knob(options, assignment);
    return set ? std::string{} : set.error().message;
  };
  EXPECT_THAT(message("recording.frame_rate=30"),
              HasSubstr("did you mean recording.frame_rate_hz?"));
  EXPECT_THAT(message("recording.frame_rate_hz=0"), HasSubstr("recording.frame_rate_hz"));
  EXPECT_THAT(message("recording.frame_rate_hz"), HasSubstr("NAME=VALUE"));
  EXPECT_THAT(apply_preset(options, "hard-shock").error().message, HasSubstr("hard-shocks"));
  options.scene = "ofice";
  const auto simulation = Simulation::create(options);
  ASSERT_FALSE(simulation);
  EXPECT_THAT(simulation.error().message, HasSubstr("office"));
}

TEST(SimulatedRecording, TheSameSeedGivesTheSameBytes) {
  const tests::TemporaryDirectory folder;
  ASSERT_TRUE(write(small(), folder.path() / "a" / "bag"));
  ASSERT_TRUE(write(small(), folder.path() / "b" / "bag"));
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator{folder.path() / "a" / "bag"}) {
    const auto other = folder.path() / "b" / "bag" / entry.path().filename();
    EXPECT_TRUE(content(entry.path()) == content(other)) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 6U);  // database, metadata, two trajectories, table, parameters
  SimulationOptions other = small();
  other.seed = 4;
  ASSERT_TRUE(write(other, folder.path() / "c" / "bag"));
  EXPECT_NE(content(folder.path() / "a/bag/bag_0.db3"), content(folder.path() / "c/bag/bag_0.db3"));
}

TEST(SimulatedRecording, IsReadBackWithItsCalibrationAndRates) {
  const tests::TemporaryDirectory folder;
  const auto bag = folder.path() / "bag";
  const auto written = write(small(), bag);
  ASSERT_TRUE(written) << written.error().message;
  auto streams = drivers::RecordedStreams::open({.path = bag});
  ASSERT_TRUE(streams) << streams.error().message;
  const Calibration& calibration = (*streams)->calibration();
  ASSERT_TRUE(calibration.T_base_cam && calibration.T_cam_imu);
  EXPECT_LT((calibration.T_base_cam->inverse() * simulator::go2_T_base_cam()).log().norm(), 1e-9);
  EXPECT_LT((calibration.T_cam_imu->inverse() * simulator::d435i_T_cam_imu()).log().norm(), 1e-9);
  EXPECT_EQ(calibration.camera.width, 160);
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  ASSERT_TRUE((*streams)->imu()->start(recorder));
  ASSERT_TRUE((*streams)->legs()->start(recorder));
  for (auto more = (*streams)->step(); more && *more; more = (*streams)->step()) {
  }
  EXPECT_EQ(recorder.colors.size(), 11U);
  EXPECT_EQ(recorder.depths.size(), 11U);
  EXPECT_EQ(recorder.imus.size(), 201U);
  EXPECT_EQ(recorder.legs.size(), 501U);
  EXPECT_EQ(recorder.velocities.size(), 201U);
  EXPECT_EQ(recorder.colors[3].t_device.time_since_epoch(),
            (Simulation::kStart + std::chrono::milliseconds{300}).time_since_epoch());
  EXPECT_GT(recorder.colors[3].t_arrival, Simulation::kStart + std::chrono::milliseconds{325});
  EXPECT_EQ(recorder.colors[3].sample.image.shape().format, PixelFormat::kBgr8);
  // It stands still at first: the legs of a standing Go2, and gravity.
  EXPECT_NEAR(recorder.imus[20].sample.accel_mps2.norm(), 9.81, 0.5);
}

TEST(SimulatedRecording, TheTruthIsOneMotionOfTwoFrames) {
  const tests::TemporaryDirectory folder;
  ASSERT_TRUE(write(small(), folder.path() / "bag"));
  const auto camera = read_trajectory(folder.path() / "bag" / "groundtruth.txt");
  const auto base = read_trajectory(folder.path() / "bag" / "groundtruth_base.txt");
  ASSERT_TRUE(camera && base);
  ASSERT_EQ(camera->poses.size(), 11U);
  for (std::size_t i = 0; i < camera->poses.size(); ++i) {
    const SE3& T_world_cam = camera->poses[i].pose;
    const SE3& T_world_base = base->poses[i].pose;
    const SE3 T_base_cam = T_world_base.inverse() * T_world_cam;
    EXPECT_LT((T_base_cam.inverse() * simulator::go2_T_base_cam()).log().norm(), 1e-7);
    EXPECT_EQ(camera->poses[i].t,
              Simulation::kStart + std::chrono::milliseconds{100 * static_cast<int>(i)});
  }
  std::istringstream table{content(folder.path() / "bag" / "truth.csv")};
  std::string header;
  std::string line;
  std::getline(table, header);
  std::size_t lines = 0;
  while (std::getline(table, line)) {
    EXPECT_EQ(std::ranges::count(line, ','), std::ranges::count(header, ','));
    ++lines;
  }
  EXPECT_EQ(lines, 201U);
}

TEST(SimulatedRecording, AlsoAsTum) {
  const tests::TemporaryDirectory folder;
  const auto written = write(small(), folder.path() / "bag", true);
  ASSERT_TRUE(written) << written.error().message;
  auto bag = drivers::RecordedStreams::open({.path = folder.path() / "bag"});
  auto tum = drivers::RecordedStreams::open({.path = folder.path() / "bag" / "tum"});
  ASSERT_TRUE(tum) << tum.error().message;
  EXPECT_EQ((*tum)->info().format, "tum");
  EXPECT_EQ((*tum)->calibration().camera.fx, (*bag)->calibration().camera.fx);
  Recorder from_bag;
  Recorder from_tum;
  for (const auto& [streams, recorder] :
       {std::pair{&**bag, &from_bag}, std::pair{&**tum, &from_tum}}) {
    ASSERT_TRUE(streams->camera().start(*recorder));
    for (auto more = streams->step(); more && *more; more = streams->step()) {
    }
  }
  ASSERT_EQ(from_tum.depths.size(), from_bag.depths.size());
  for (std::size_t i = 0; i < from_tum.depths.size(); ++i) {
    EXPECT_TRUE(std::ranges::equal(from_tum.depths[i].sample.image.bytes(),
                                   from_bag.depths[i].sample.image.bytes()));
    EXPECT_TRUE(std::ranges::equal(from_tum.colors[i].sample.image.bytes(),
                                   from_bag.colors[i].sample.image.bytes()));
  }
  EXPECT_TRUE(read_trajectory(folder.path() / "bag/tum/groundtruth.txt"));
}

TEST(SimulatedRecording, AnInterruptedOneLeavesNothing) {
  const tests::TemporaryDirectory folder;
  auto simulation = Simulation::create(small());
  ASSERT_TRUE(simulation);
  const auto finished =
      write_simulation(**simulation, {.directory = folder.path() / "bag"},
                       [](std::size_t done, std::size_t /*total*/) { return done < 3; });
  ASSERT_TRUE(finished);
  EXPECT_FALSE(*finished);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(SimulatedRecording, OnlyASimulationIsReplaced) {
  const tests::TemporaryDirectory folder;
  const auto bag = folder.path() / "bag";
  ASSERT_TRUE(write(small(), bag));
  EXPECT_TRUE(is_same_simulation(bag, to_json(small())));
  SimulationOptions other = small();
  other.seed = 9;
  EXPECT_FALSE(is_same_simulation(bag, to_json(other)));
  const auto again = write(small(), bag);
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().message, HasSubstr("exists"));
  EXPECT_TRUE(remove_simulation(bag));
  fs::create_directories(folder.path() / "precious");
  std::ofstream{folder.path() / "precious" / "file"} << "x";
  EXPECT_FALSE(remove_simulation(folder.path() / "precious"));
  EXPECT_TRUE(fs::exists(folder.path() / "precious" / "file"));
}

TEST(SimulatedRecording, DeviceClocksDrift) {
  const tests::TemporaryDirectory folder;
  SimulationOptions options = small();
  options.recording.device_clocks = true;
  options.recording.clock_drift_ppm = 500;
  ASSERT_TRUE(write(options, folder.path() / "bag"));
  auto streams = drivers::RecordedStreams::open({.path = folder.path() / "bag"});
  ASSERT_TRUE(streams);
  EXPECT_EQ((*streams)->camera().stamps().domain, StampDomain::kDevice);
  Recorder recorder;
  ASSERT_TRUE((*streams)->imu()->start(recorder));
  for (auto more = (*streams)->step(); more && *more; more = (*streams)->step()) {
  }
  const Duration span = recorder.imus.back().t_device - recorder.imus.front().t_device;
  EXPECT_EQ(span, std::chrono::microseconds{1'000'500});
}

}  // namespace
}  // namespace geoflow::tools
