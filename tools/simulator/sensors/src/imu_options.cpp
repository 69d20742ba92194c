#include <array>
#include <limits>
#include <span>

#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {
namespace {

using Row = Knob<ImuOptions>;

// NOLINTBEGIN(readability-magic-numbers): the table says what each number is
constexpr std::array kRows{
    Row{"imu.rate_hz", "Hz", "samples a second", &ImuOptions::rate_hz, 50, 1000},
    Row{"imu.noise_scale", "1", "white noise and random walk; 1 is the D435i's",
        &ImuOptions::noise_scale, 0, 20},
    Row{"imu.accel_bias_mps2", "m/s^2", "accelerometer bias at the start, by axis",
        &ImuOptions::accel_bias_mps2, 0, 1},
    Row{"imu.gyro_bias_radps", "rad/s", "gyroscope bias at the start, by axis",
        &ImuOptions::gyro_bias_radps, 0, 0.1},
    Row{"imu.scale_error", "1", "error of an axis' scale", &ImuOptions::scale_error, 0, 0.05},
    Row{"imu.misalignment_rad", "rad", "error of an axis' direction", &ImuOptions::misalignment_rad,
        0, 0.05},
    Row{"imu.gyro_per_accel", "rad/s per m/s^2", "how much the gyroscope feels acceleration",
        &ImuOptions::gyro_per_accel, 0, 0.01},
    Row{"imu.quantise", "", "round to 0.001 g and 0.1 deg/s", &ImuOptions::quantise, 0, 1},
    Row{"imu.accel_range_mps2", "m/s^2", "accelerometer's limit", &ImuOptions::accel_range_mps2, 10,
        1000},
    Row{"imu.gyro_range_radps", "rad/s", "gyroscope's limit", &ImuOptions::gyro_range_radps, 1,
        100},
    Row{"imu.shock_mps2", "m/s^2", "hardest shock when a foot lands; 8 usual, 40 as in the paper",
        &ImuOptions::shock_mps2, 0, 80},
    Row{"imu.shock_gyro_radps", "rad/s", "hardest shake of the mount then",
        &ImuOptions::shock_gyro_radps, 0, 5},
    Row{"imu.shock_ring_hz", "Hz", "the mount's resonance, to within a quarter",
        &ImuOptions::shock_ring_hz, 20, 100},
    Row{"imu.shock_damping", "1", "its damping, of critical", &ImuOptions::shock_damping, 0.02,
        0.7},
    Row{"imu.fault_interval_s", "s", "time between bursts of distortion, on average; 0 has none",
        &ImuOptions::fault_interval_s, 0, 3600},
    Row{"imu.fault_s", "s", "length of such a burst, on average", &ImuOptions::fault_s, 0.1, 60},
    Row{"imu.fault_mps2", "m/s^2", "its amplitude", &ImuOptions::fault_mps2, 0, 80}};
// NOLINTEND(readability-magic-numbers)

constexpr double kHardShockMps2 = 40;
constexpr double kHardShockGyroRadps = 1.5;

}  // namespace

std::span<const Knob<ImuOptions>> imu_knobs() {
  return kRows;
}

ImuOptions exact_imu() {
  ImuOptions options;
  options.noise_scale = 0;
  options.accel_bias_mps2 = 0;
  options.gyro_bias_radps = 0;
  options.scale_error = 0;
  options.misalignment_rad = 0;
  options.gyro_per_accel = 0;
  options.quantise = false;
  options.accel_range_mps2 = std::numeric_limits<double>::infinity();
  options.gyro_range_radps = std::numeric_limits<double>::infinity();
  options.shock_mps2 = 0;
  options.shock_gyro_radps = 0;
  options.fault_interval_s = 0;
  return options;
}

ImuOptions with_hard_shocks(ImuOptions options) {
  options.shock_mps2 = kHardShockMps2;
  options.shock_gyro_radps = kHardShockGyroRadps;
  return options;
}

}  // namespace geoflow::simulator
