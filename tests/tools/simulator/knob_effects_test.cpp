#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

#include "simulate/settings.hpp"

// Every knob changes what it is about, and nothing else.
namespace geoflow::tools {
namespace {

using simulator::Simulation;
using simulator::SimulationOptions;
using testing::IsSubsetOf;

/// How far each knob is turned; behind it, another one that must be turned for it to matter.
constexpr std::string_view kTurns = R"(scene.light_level=0.1
scene.texture_contrast=2
scene.reflectivity=5
scene.pedestrians=9
camera.width=80
camera.height=60
camera.exposure_min_s=0.03 scene.light_level=50
camera.exposure_max_s=0.002
camera.gain_max=2 scene.light_level=0.01
camera.exposure_compensation=2
camera.noise_scale=3
camera.subexposures=2
camera.readout_s=0.005
camera.depth_offset_s=0.03
camera.depth_noise_scale=2
camera.depth_errors=0
camera.depth_subpixel_px=0.3
camera.depth_calibration_px=0.3
camera.depth_min_m=1.5
camera.depth_max_m=1.5
camera.projector_power=0.1
robot.speed_mps=0.4
robot.speed_variation=0.4
robot.yaw_rate_radps=0.2
robot.stand_s=0.4
robot.pause_interval_s=2
robot.pause_s=5 robot.pause_interval_s=2
robot.gait_hz=2.7
robot.gait_variation=0.08
robot.duty=0.7
robot.jitter=1.25
robot.jitter_variation=0.4
robot.wander=2
robot.body_height_m=0.28
robot.step_height_m=0.1
robot.touchdown_mps=0.5
robot.foothold_noise_m=0.02
robot.rolling_radius_m=0
robot.slip_probability=0.5
robot.slip_length_m=0.05 robot.slip_probability=0.5
robot.ground_sink_m=0.02
legs.rate_hz=250
legs.angle_noise_rad=0.005
legs.angle_offset_rad=0.02
legs.rate_noise_scale=3
legs.quantise=0
legs.torque_noise_nm=2
legs.torque_scale_error=0.15
legs.friction_nm=1.5
legs.leg_mass_scale=0
legs.force_offset_counts=150
legs.force_counts_per_n=3
legs.force_rise_s=0.2
legs.force_noise_counts=20
imu.rate_hz=400
imu.noise_scale=5
imu.accel_bias_mps2=0.5
imu.gyro_bias_radps=0.05
imu.scale_error=0.03
imu.misalignment_rad=0.03
imu.gyro_per_accel=0.005
imu.quantise=0
imu.accel_range_mps2=10
imu.gyro_range_radps=1 robot.jitter=2
imu.shock_mps2=40
imu.shock_gyro_radps=2
imu.shock_ring_hz=60
imu.shock_damping=0.5
imu.fault_interval_s=1
imu.fault_s=5 imu.fault_interval_s=1
imu.fault_mps2=60 imu.fault_interval_s=1
recording.frame_rate_hz=2
recording.camera_latency_s=0.1
recording.camera_jitter_s=0.05
recording.imu_latency_s=0.1
recording.imu_jitter_s=0.05
recording.leg_latency_s=0.1
recording.leg_jitter_s=0.05
recording.device_clocks=1
recording.clock_drift_ppm=300 recording.device_clocks=1
recording.odometry_rate_hz=50
recording.odometry_scale_error=0.2
recording.odometry_noise_mps=0.5
recording.odometry_gyro_noise_radps=0.5)";

struct Turn {
  std::string setting;
  std::vector<std::string> given;

  [[nodiscard]] std::string_view knob() const {
    return std::string_view{setting}.substr(0, setting.find('='));
  }
  [[nodiscard]] std::string_view room() const {
    return std::string_view{setting}.substr(0, setting.find('.'));
  }
};

std::vector<Turn> turns() {
  std::vector<Turn> all;
  std::istringstream lines{std::string{kTurns}};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words{line};
    Turn& turn = all.emplace_back();
    words >> turn.setting;
    for (std::string other; words >> other;) {
      turn.given.push_back(other);
    }
  }
  return all;
}

/// All that each stream says, as bytes.
using Streams = std::map<std::string_view, std::string>;

class Listener final : public CameraSink, public ImuSink, public LegSink {
 public:
  explicit Listener(Streams& heard) : heard_{heard} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    add("color", frame.sample.image.bytes());
    add_times("color", frame);
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    add("depth", frame.sample.image.bytes());
    add_times("depth", frame);
  }
  void on_imu(const Arrival<ImuClock, ImuSample>& one) override {
    add("imu", one.sample.accel_mps2);
    add("imu", one.sample.gyro_radps);
    add_times("imu", one);
  }
  void on_legs(const Arrival<LegClock, LegSample>& one) override {
    for (const JointState& joint : one.sample.joints) {
      add("legs", Vector3d{joint.q_rad, joint.dq_radps, joint.tau_nm});
    }
    add("legs", std::as_bytes(std::span{one.sample.foot_force}));
    add_times("legs", one);
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& one) override {
    add("odometry", one.sample.v_base_mps);
    add("odometry", one.sample.w_base_radps);
    add_times("odometry", one);
  }

 private:
  void add(std::string_view name, std::span<const std::byte> bytes) {
    std::string& stream = heard_[name];
    std::ranges::transform(bytes, std::back_inserter(stream),
                           [](std::byte byte) { return static_cast<char>(byte); });
  }
  void add(std::string_view name, const Vector3d& vector) {
    add(name, std::as_bytes(std::span{vector.data(), 3}));
  }
  template <typename Any>
  void add_times(std::string_view name, const Any& arrival) {
    const std::array<std::int64_t, 2> times{arrival.t_device.time_since_epoch().count(),
                                            arrival.t_arrival.time_since_epoch().count()};
    add(name, std::as_bytes(std::span{times}));
  }

  Streams& heard_;
};

std::set<std::string_view> differences(const Streams& a, const Streams& b) {
  std::set<std::string_view> names;
  for (const auto& [name, bytes] : a) {
    if (!b.contains(name) || b.at(name) != bytes) {
      names.insert(name);
    }
  }
  return names;
}

/// Six seconds through a home, round a corner, seen once a second by a camera of few pixels.
Streams simulate(const std::vector<std::string>& settings) {
  SimulationOptions options{.scene = "home", .seed = 2, .duration_s = 6};
  for (const char* const common : {"camera.width=64", "camera.height=48", "robot.stand_s=0",
                                   "recording.frame_rate_hz=1", "robot.speed_mps=1.2"}) {
    EXPECT_TRUE(set_knob(options, common)) << common;
  }
  for (const std::string& setting : settings) {
    EXPECT_TRUE(set_knob(options, setting)) << setting;
  }
  Streams streams;
  auto simulation = Simulation::create(options);
  EXPECT_TRUE(simulation) << (simulation ? "" : simulation.error().message);
  if (simulation) {
    Listener listener{streams};
    EXPECT_TRUE((*simulation)
                    ->run({.camera = listener,
                           .imu = listener,
                           .legs = listener,
                           .truth = [](const auto& /*truth*/) {},
                           .frame_truth = [](const auto& /*truth*/) {}},
                          [](std::size_t /*frames*/) { return true; }));
  }
  return streams;
}

/// What a room's knobs may change.
std::set<std::string_view> about(std::string_view room) {
  if (room == "scene" || room == "camera") {
    return {"color", "depth"};
  }
  if (room == "legs" || room == "imu") {
    return {room};
  }
  return {"color", "depth", "imu", "legs", "odometry"};
}

class KnobsOf : public testing::TestWithParam<const char*> {};

TEST_P(KnobsOf, ChangeWhatTheyAreAboutAndNothingElse) {
  const Streams usual = simulate({});
  EXPECT_TRUE(differences(usual, simulate({})).empty());
  for (const Turn& turn : turns()) {
    if (turn.room() != GetParam()) {
      continue;
    }
    std::vector<std::string> turned = turn.given;
    turned.push_back(turn.setting);
    const auto changed =
        differences(turn.given.empty() ? usual : simulate(turn.given), simulate(turned));
    EXPECT_FALSE(changed.empty()) << turn.setting << " changes nothing";
    EXPECT_THAT(changed, IsSubsetOf(about(turn.room()))) << turn.setting;
  }
}

INSTANTIATE_TEST_SUITE_P(Rooms, KnobsOf,
                         testing::Values("scene", "camera", "robot", "legs", "imu", "recording"),
                         [](const auto& room) { return std::string{room.param}; });

TEST(KnobTurns, AreOfAllKnobs) {
  std::set<std::string_view> known;
  for (const simulator::KnobInfo& knob : all_knobs()) {
    known.insert(knob.name);
  }
  const std::vector<Turn> all = turns();
  std::set<std::string_view> turned;
  for (const Turn& turn : all) {
    turned.insert(turn.knob());
  }
  EXPECT_EQ(turned, known);
}

}  // namespace
}  // namespace geoflow::tools
