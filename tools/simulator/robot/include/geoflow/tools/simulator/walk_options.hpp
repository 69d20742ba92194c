#pragma once

#include <cstdint>
#include <span>

#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {

/// How the simulated Go2 walks. Ranges and explanations are in walk_knobs(). Sources of the
/// defaults: Unitree's published model; a physics simulation of the Go2 trotting at 0.2 and 0.36
/// m/s; recordings of a real Go1 (body IMU and motion capture); a real Go2's joint angles while
/// standing.
struct WalkOptions {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member, its unit by the
  // knob
  std::uint64_t seed = 1;
  double duration_s = 60;

  double speed_mps = 0.5;
  double speed_variation = 0.1;
  double yaw_rate_radps = 0.8;
  double stand_s = 2.5;
  double pause_interval_s = 0;
  double pause_s = 2;

  double gait_hz = 2;
  double gait_variation = 0.03;
  double duty = 0.56;
  double jitter = 1;
  double jitter_variation = 0.25;
  double wander = 1;
  double body_height_m = 0.32;

  double step_height_m = 0.08;
  double touchdown_mps = 0.15;
  double foothold_noise_m = 0.008;
  double rolling_radius_m = 0.022;
  double slip_probability = 0.01;
  double slip_length_m = 0.02;
  double ground_sink_m = 0;
  // NOLINTEND(readability-magic-numbers)
};

/// The walk's rows of the table of knobs, named "robot.…".
[[nodiscard]] std::span<const Knob<WalkOptions>> walk_knobs();

/// The fast, pronounced motion of GeoFlow-SLAM's recordings ("fast motion jitter", "image blur"):
/// three strides a second at one and a quarter of the measured amplitudes, which lets the feet
/// become almost weightless between steps. Other options stay as given.
[[nodiscard]] WalkOptions with_pronounced_trot(WalkOptions options);

}  // namespace geoflow::simulator
