#include <array>
#include <span>

#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"

namespace geoflow::simulator {
namespace {

using Row = Knob<LegSensorOptions>;

// NOLINTBEGIN(readability-magic-numbers): the table says what each number is
constexpr std::array kRows{
    Row{"legs.rate_hz", "Hz", "samples a second", &LegSensorOptions::rate_hz, 50, 1000},
    Row{"legs.angle_noise_rad", "rad", "noise of a joint angle", &LegSensorOptions::angle_noise_rad,
        0, 0.01},
    Row{"legs.angle_offset_rad", "rad", "error of a joint's zero, by joint",
        &LegSensorOptions::angle_offset_rad, 0, 0.05},
    Row{"legs.rate_noise_scale", "1",
        "noise of joint rates; 1 is a real Go2's 0.029, 0.047 and 0.013 rad/s",
        &LegSensorOptions::rate_noise_scale, 0, 10},
    Row{"legs.quantise", "", "round to the motors' smallest steps", &LegSensorOptions::quantise, 0,
        1},
    Row{"legs.torque_noise_nm", "Nm", "noise of a joint torque", &LegSensorOptions::torque_noise_nm,
        0, 5},
    Row{"legs.torque_scale_error", "1", "error of a torque's scale, by joint",
        &LegSensorOptions::torque_scale_error, 0, 0.2},
    Row{"legs.friction_nm", "Nm", "Coulomb friction of a joint, which its torque includes",
        &LegSensorOptions::friction_nm, 0, 2},
    Row{"legs.leg_mass_scale", "1", "the legs' own mass; 0 makes torques those of support alone",
        &LegSensorOptions::leg_mass_scale, 0, 2},
    Row{"legs.force_offset_counts", "", "greatest offset of a foot force sensor, by foot",
        &LegSensorOptions::force_offset_counts, 0, 200},
    Row{"legs.force_counts_per_n", "1/N", "gain of the foot force sensors",
        &LegSensorOptions::force_counts_per_n, 0.1, 20},
    Row{"legs.force_rise_s", "s",
        "rise time of the foot force sensors, 10 to 90 percent of a step; in a trot they "
        "are at their first peak sooner",
        &LegSensorOptions::force_rise_s, 0, 0.3},
    Row{"legs.force_noise_counts", "", "noise of the foot force sensors",
        &LegSensorOptions::force_noise_counts, 0, 50}};
// NOLINTEND(readability-magic-numbers)

}  // namespace

std::span<const Knob<LegSensorOptions>> leg_knobs() {
  return kRows;
}

LegSensorOptions exact_legs() {
  LegSensorOptions options;
  options.angle_noise_rad = 0;
  options.angle_offset_rad = 0;
  options.rate_noise_scale = 0;
  options.quantise = false;
  options.torque_noise_nm = 0;
  options.torque_scale_error = 0;
  options.friction_nm = 0;
  options.leg_mass_scale = 0;
  options.force_offset_counts = 0;
  options.force_counts_per_n = 1;
  options.force_rise_s = 0;
  options.force_noise_counts = 0;
  return options;
}

}  // namespace geoflow::simulator
