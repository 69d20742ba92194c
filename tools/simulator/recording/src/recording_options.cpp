#include "geoflow/tools/simulator/recording_options.hpp"

#include <array>
#include <span>

#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {
namespace {

using Options = RecordingOptions;

// NOLINTBEGIN(readability-magic-numbers): ranges, beside the names of what they bound
constexpr auto kKnobs = std::to_array<Knob<Options>>({
    {.name = "recording.frame_rate_hz",
     .unit = "Hz",
     .summary = "pairs of colour and depth images a second",
     .member = &Options::frame_rate_hz,
     .minimum = 1,
     .maximum = 90},
    {.name = "recording.camera_latency_s",
     .unit = "s",
     .summary = "from the end of an image's readout to its arrival",
     .member = &Options::camera_latency_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.camera_jitter_s",
     .unit = "s",
     .summary = "mean further delay of an image",
     .member = &Options::camera_jitter_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.imu_latency_s",
     .unit = "s",
     .summary = "from an inertial sample to its arrival",
     .member = &Options::imu_latency_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.imu_jitter_s",
     .unit = "s",
     .summary = "mean further delay of an inertial sample",
     .member = &Options::imu_jitter_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.leg_latency_s",
     .unit = "s",
     .summary = "from a sample of the legs, or of the robot's odometry, to its arrival",
     .member = &Options::leg_latency_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.leg_jitter_s",
     .unit = "s",
     .summary = "mean further delay of those",
     .member = &Options::leg_jitter_s,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.device_clocks",
     .unit = "",
     .summary = "stamps by the devices' own clocks, with offset and drift, instead of the host's",
     .member = &Options::device_clocks,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.clock_drift_ppm",
     .unit = "ppm",
     .summary = "how much faster the camera's clock runs, and slower the legs'",
     .member = &Options::clock_drift_ppm,
     .minimum = -500,
     .maximum = 500},
    {.name = "recording.odometry_rate_hz",
     .unit = "Hz",
     .summary = "the robot's own odometry; 0: none",
     .member = &Options::odometry_rate_hz,
     .minimum = 0,
     .maximum = 1000},
    {.name = "recording.odometry_scale_error",
     .unit = "1",
     .summary = "standard deviation of its scale, drawn for each axis",
     .member = &Options::odometry_scale_error,
     .minimum = 0,
     .maximum = 0.5},
    {.name = "recording.odometry_noise_mps",
     .unit = "m/s",
     .summary = "noise of its velocity, each axis and sample",
     .member = &Options::odometry_noise_mps,
     .minimum = 0,
     .maximum = 1},
    {.name = "recording.odometry_gyro_noise_radps",
     .unit = "rad/s",
     .summary = "noise of its turn rate, each axis and sample",
     .member = &Options::odometry_gyro_noise_radps,
     .minimum = 0,
     .maximum = 1},
});
// NOLINTEND(readability-magic-numbers)

}  // namespace

std::span<const Knob<RecordingOptions>> recording_knobs() {
  return kKnobs;
}

}  // namespace geoflow::simulator
