#include "geoflow/tools/simulator/recording_options.hpp"

#include <array>
#include <span>

#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {

std::span<const Knob<RecordingOptions>> recording_knobs() {
  using Options = RecordingOptions;
  // NOLINTBEGIN(readability-magic-numbers): ranges, beside the names of what they bound
  static constexpr auto kKnobs = std::to_array<Knob<Options>>({
      {"recording.frame_rate_hz", "Hz", "pairs of colour and depth images a second",
       &Options::frame_rate_hz, 1, 90},
      {"recording.camera_latency_s", "s", "from the end of an image's readout to its arrival",
       &Options::camera_latency_s, 0, 1},
      {"recording.camera_jitter_s", "s", "mean further delay of an image",
       &Options::camera_jitter_s, 0, 1},
      {"recording.imu_latency_s", "s", "from an inertial sample to its arrival",
       &Options::imu_latency_s, 0, 1},
      {"recording.imu_jitter_s", "s", "mean further delay of an inertial sample",
       &Options::imu_jitter_s, 0, 1},
      {"recording.leg_latency_s", "s",
       "from a sample of the legs, or of the robot's odometry, to its arrival",
       &Options::leg_latency_s, 0, 1},
      {"recording.leg_jitter_s", "s", "mean further delay of those", &Options::leg_jitter_s, 0, 1},
      {"recording.device_clocks", "",
       "stamps by the devices' own clocks, with offset and drift, instead of the host's",
       &Options::device_clocks, 0, 1},
      {"recording.clock_drift_ppm", "ppm",
       "how much faster the camera's clock runs, and slower the legs'", &Options::clock_drift_ppm,
       -500, 500},
      {"recording.odometry_rate_hz", "Hz", "the robot's own odometry; 0: none",
       &Options::odometry_rate_hz, 0, 1000},
      {"recording.odometry_scale_error", "1",
       "standard deviation of its scale, drawn for each axis", &Options::odometry_scale_error, 0,
       0.5},
      {"recording.odometry_noise_mps", "m/s", "noise of its velocity, each axis and sample",
       &Options::odometry_noise_mps, 0, 1},
      {"recording.odometry_gyro_noise_radps", "rad/s",
       "noise of its turn rate, each axis and sample", &Options::odometry_gyro_noise_radps, 0, 1},
  });
  // NOLINTEND(readability-magic-numbers)
  return kKnobs;
}

}  // namespace geoflow::simulator
