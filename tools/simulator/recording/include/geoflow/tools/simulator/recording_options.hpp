#pragma once

#include <span>

#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {

/// How samples reach the host. Ranges and explanations are in recording_knobs(). A sample arrives
/// its latency after its measurement has ended, plus an exponentially distributed delay whose mean
/// is the jitter; a stream's samples never overtake each other.
struct RecordingOptions {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member, its unit by the
  // knob
  double frame_rate_hz = 30;
  double camera_latency_s = 0.025;
  double camera_jitter_s = 0.002;
  double imu_latency_s = 0.002;
  double imu_jitter_s = 0.0005;
  double leg_latency_s = 0.001;
  double leg_jitter_s = 0.0005;

  bool device_clocks = false;
  double clock_drift_ppm = 20;

  double odometry_rate_hz = 200;
  double odometry_scale_error = 0.01;
  double odometry_noise_mps = 0.03;
  double odometry_gyro_noise_radps = 0.01;
  // NOLINTEND(readability-magic-numbers)
};

/// The rows "recording.…" of the table of knobs.
[[nodiscard]] std::span<const Knob<RecordingOptions>> recording_knobs();

}  // namespace geoflow::simulator
