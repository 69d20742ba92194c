#include "geoflow/tools/simulator/simulation.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/cpu_time.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/recording_options.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/walk.hpp"

#include "arrivals.hpp"
#include "body_odometry.hpp"

namespace geoflow::simulator {
namespace {

/// How far the devices' clocks are from the host's at the simulation's start.
constexpr Duration kClockOffset = std::chrono::seconds{-700};
constexpr double kPerMillion = 1e-6;

/// A device's clock on the host's time line.
struct DeviceClockModel {
  Duration offset{};
  double drift = 0;

  template <typename Clock>
  [[nodiscard]] DeviceTime<Clock> at(HostTime t) const {
    const Duration drifted = from_seconds(drift * to_seconds(t - Simulation::kStart));
    return DeviceTime<Clock>{t.time_since_epoch() + offset + drifted};
  }
};

HostTime host_time(double t_s) {
  return Simulation::kStart + from_seconds(t_s);
}

/// Sample times at index / rate_hz from 0 to the duration, each with a further time to measure.
std::vector<HostTime> sample_times(double rate_hz, double duration_s, double measuring_s = 0) {
  std::vector<HostTime> times;
  if (rate_hz > 0) {
    const auto count = static_cast<std::size_t>(std::floor(duration_s * rate_hz)) + 1;
    for (std::size_t i = 0; i < count; ++i) {
      times.push_back(host_time(static_cast<double>(i) / rate_hz + measuring_s));
    }
  }
  return times;
}

Calibration make_calibration(const SimulationOptions& options, const CameraIntrinsics& camera) {
  Calibration calibration;
  calibration.camera = camera;
  calibration.depth_alignment = DepthAlignment::kNearestTouching;  // as align_to_color() does it
  calibration.T_cam_imu = d435i_T_cam_imu();
  calibration.T_base_cam = go2_T_base_cam();
  calibration.imu_noise = options.imu.noise;
  // What an estimator is told must not be zero where the simulated sensor is exact.
  if (options.imu.noise_scale > 0) {
    calibration.imu_noise.accel_noise_density *= options.imu.noise_scale;
    calibration.imu_noise.gyro_noise_density *= options.imu.noise_scale;
    calibration.imu_noise.accel_random_walk *= options.imu.noise_scale;
    calibration.imu_noise.gyro_random_walk *= options.imu.noise_scale;
  }
  calibration.imu_noise.rate_hz = options.imu.rate_hz;
  calibration.source = fmt::format("simulation of {}, seed {}", options.scene, options.seed);
  calibration.serial = "simulated";
  return calibration;
}

}  // namespace

class Simulation::Implementation {
 public:
  Implementation(SimulationOptions options, Scene scene, Walk walk)
      : options_{std::move(options)},
        scene_{std::move(scene)},
        walk_{std::move(walk)},
        legs_{walk_, options_.seed, options_.legs},
        odometry_{options_.seed, options_.recording},
        imu_{ImuSimulator{walk_, go2_T_base_cam() * d435i_T_cam_imu(), options_.seed, options_.imu}
                 .readings()} {
    if (options_.recording.device_clocks) {
      const double drift = options_.recording.clock_drift_ppm * kPerMillion;
      camera_clock_ = {.offset = kClockOffset, .drift = drift};
      leg_clock_ = {.offset = 2 * kClockOffset, .drift = -drift};
    }
  }

  [[nodiscard]] Result<void> start_camera() {
    auto camera = CameraSimulator::create(scene_, options_.camera);
    if (!camera) {
      return tl::unexpected{std::move(camera.error())};
    }
    camera_ = *std::move(camera);
    calibration_ = make_calibration(options_, camera_->intrinsics());
    return {};
  }

  [[nodiscard]] const Calibration& calibration() const noexcept { return calibration_; }

  [[nodiscard]] StampInfo stamps() const noexcept {
    return {.domain = options_.recording.device_clocks ? StampDomain::kDevice : StampDomain::kHost};
  }

  [[nodiscard]] const SimulationCost& cost() const noexcept { return cost_; }

  [[nodiscard]] std::size_t frames() const {
    return sample_times(options_.recording.frame_rate_hz, options_.duration_s).size();
  }

  [[nodiscard]] Result<bool> run(const SimulationSinks& sinks,
                                 const std::function<bool(std::size_t)>& go_on) {
    for (const PlannedArrival& arrival : plan()) {
      const bool image = arrival.kind == SampleKind::kColor || arrival.kind == SampleKind::kDepth;
      if (image && !rendered_.contains(arrival.index)) {
        render(arrival.index, sinks);
        if (!go_on(++rendered_count_)) {
          return false;
        }
      }
      const double begin_s = thread_cpu_s();
      deliver(arrival, sinks);
      cost_.delivery_s += thread_cpu_s() - begin_s;
    }
    return true;
  }

 private:
  [[nodiscard]] std::vector<PlannedArrival> plan() const {
    const RecordingOptions& recording = options_.recording;
    const double duration_s = options_.duration_s;
    const double readout_s = (options_.camera.exposure_max_s + options_.camera.readout_s) / 2;
    const Delay camera{.latency_s = recording.camera_latency_s,
                       .jitter_s = recording.camera_jitter_s};
    const Delay legs{.latency_s = recording.leg_latency_s, .jitter_s = recording.leg_jitter_s};
    std::vector<HostTime> imu_times;
    imu_times.reserve(imu_.size());
    for (const ImuReading& reading : imu_) {
      imu_times.push_back(host_time(reading.t_s));
    }
    const auto images = sample_times(recording.frame_rate_hz, duration_s, readout_s);
    const auto add = [&](const PlannedStream& stream, std::string_view name,
                         std::vector<PlannedArrival>& all) {
      plan_arrivals(stream, RandomStream{options_.seed, name}, all);
    };
    std::vector<PlannedArrival> all;
    add({.kind = SampleKind::kImu,
         .delay = {.latency_s = recording.imu_latency_s, .jitter_s = recording.imu_jitter_s},
         .measured = imu_times},
        "arrival.imu", all);
    add({.kind = SampleKind::kLegs,
         .delay = legs,
         .measured = sample_times(options_.legs.rate_hz, duration_s)},
        "arrival.legs", all);
    add({.kind = SampleKind::kOdometry,
         .delay = legs,
         .measured = sample_times(recording.odometry_rate_hz, duration_s)},
        "arrival.odometry", all);
    add({.kind = SampleKind::kColor, .delay = camera, .measured = images}, "arrival.color", all);
    add({.kind = SampleKind::kDepth, .delay = camera, .measured = images}, "arrival.depth", all);
    std::ranges::sort(all);
    return all;
  }

  [[nodiscard]] BodyState body(double t_s) const {
    return walk_.body().at(std::clamp(t_s, 0.0, walk_.duration_s()));
  }

  [[nodiscard]] double frame_time(std::size_t index) const {
    return static_cast<double>(index) / options_.recording.frame_rate_hz;
  }

  void render(std::size_t index, const SimulationSinks& sinks) {
    const double t_s = frame_time(index);
    const SE3 T_base_cam = go2_T_base_cam();
    const auto T_world_cam = [&](double at_s) { return body(at_s).T_world_base * T_base_cam; };
    const Rendered& images = rendered_[index] = camera_->render(t_s, index, T_world_cam);
    cost_.render.light_s += images.cost.light_s;
    cost_.render.sensor_s += images.cost.sensor_s;
    sinks.frame_truth({.t = host_time(t_s),
                       .T_world_base = body(t_s).T_world_base,
                       .T_world_cam = T_world_cam(t_s)});
  }

  void deliver(const PlannedArrival& arrival, const SimulationSinks& sinks) {
    switch (arrival.kind) {
      case SampleKind::kImu:
        return deliver_imu(arrival, sinks);
      case SampleKind::kLegs:
        return deliver_legs(arrival, sinks);
      case SampleKind::kOdometry:
        return deliver_odometry(arrival, sinks);
      case SampleKind::kColor:
      case SampleKind::kDepth:
        return deliver_image(arrival, sinks);
    }
  }

  void deliver_imu(const PlannedArrival& arrival, const SimulationSinks& sinks) {
    const ImuReading& reading = imu_[arrival.index];
    const HostTime t = host_time(reading.t_s);
    sinks.imu.on_imu({.t_device = camera_clock_.at<ImuClock>(t),
                      .t_arrival = arrival.t,
                      .sample = reading.sample});
    sinks.truth({.t = t,
                 .body = body(reading.t_s),
                 .imu = reading,
                 .legs = legs_.truth(std::min(reading.t_s, walk_.duration_s()))});
  }

  void deliver_legs(const PlannedArrival& arrival, const SimulationSinks& sinks) {
    if (arrival.index < legs_.size()) {
      const LegReading reading = legs_.reading(arrival.index);
      sinks.legs.on_legs({.t_device = leg_clock_.at<LegClock>(host_time(reading.t_s)),
                          .t_arrival = arrival.t,
                          .sample = reading.sample});
    }
  }

  void deliver_odometry(const PlannedArrival& arrival, const SimulationSinks& sinks) {
    const double t_s = static_cast<double>(arrival.index) / options_.recording.odometry_rate_hz;
    sinks.legs.on_body_velocity({.t_device = leg_clock_.at<LegClock>(host_time(t_s)),
                                 .t_arrival = arrival.t,
                                 .sample = odometry_.sample(arrival.index, body(t_s))});
  }

  void deliver_image(const PlannedArrival& arrival, const SimulationSinks& sinks) {
    Rendered& images = rendered_.at(arrival.index);
    const double t_s = frame_time(arrival.index);
    if (arrival.kind == SampleKind::kColor) {
      sinks.camera.on_color({.t_device = camera_clock_.at<CameraClock>(host_time(t_s)),
                             .t_arrival = arrival.t,
                             .sample = {.image = std::exchange(images.color, {})}});
    } else {
      const HostTime t = host_time(t_s + options_.camera.depth_offset_s);
      sinks.camera.on_depth({.t_device = camera_clock_.at<CameraClock>(t),
                             .t_arrival = arrival.t,
                             .sample = {.image = std::exchange(images.depth, {})}});
    }
    // An entry without images stays until its frame is past, so that it is not rendered again.
    while (!rendered_.empty() && !rendered_.begin()->second.color &&
           !rendered_.begin()->second.depth) {
      rendered_.erase(rendered_.begin());
    }
  }

  SimulationOptions options_;
  Scene scene_;
  Walk walk_;
  LegSimulator legs_;
  BodyOdometry odometry_;
  std::vector<ImuReading> imu_;
  std::unique_ptr<CameraSimulator> camera_;
  Calibration calibration_;
  DeviceClockModel camera_clock_;  // also the IMU's: both are stamped by the camera's hardware
  DeviceClockModel leg_clock_;
  std::map<std::size_t, Rendered> rendered_;  // whose images were not delivered yet
  std::size_t rendered_count_ = 0;
  SimulationCost cost_;
};

Simulation::Simulation(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}
Simulation::~Simulation() = default;

Result<std::unique_ptr<Simulation>> Simulation::create(const SimulationOptions& options) {
  SimulationOptions own = options;
  own.walk.seed = own.camera.seed = own.seed;
  own.walk.duration_s = own.duration_s;
  auto scene = make_scene(own.scene, own.seed, own.place);
  if (!scene) {
    return tl::unexpected{std::move(scene.error())};
  }
  auto walk = plan_walk(scene->path(), own.walk);
  if (!walk) {
    return tl::unexpected{std::move(walk.error())};
  }
  auto implementation =
      std::make_unique<Implementation>(std::move(own), *std::move(scene), *std::move(walk));
  if (auto started = implementation->start_camera(); !started) {
    return tl::unexpected{std::move(started.error())};
  }
  return std::unique_ptr<Simulation>{new Simulation{std::move(implementation)}};
}

const Calibration& Simulation::calibration() const noexcept {
  return implementation_->calibration();
}
StampInfo Simulation::stamps() const noexcept {
  return implementation_->stamps();
}
std::size_t Simulation::frames() const noexcept {
  return implementation_->frames();
}
const SimulationCost& Simulation::cost() const noexcept {
  return implementation_->cost();
}
Result<bool> Simulation::run(const SimulationSinks& sinks,
                             const std::function<bool(std::size_t)>& go_on) {
  return implementation_->run(sinks, go_on);
}

}  // namespace geoflow::simulator
