#include "geoflow/tools/simulator/walk_options.hpp"

#include <array>
#include <span>

#include "geoflow/tools/simulator/knob.hpp"

namespace geoflow::simulator {
namespace {

using Row = Knob<WalkOptions>;

// NOLINTBEGIN(readability-magic-numbers): the table says what each number is
constexpr std::array kRows{
    Row{"robot.speed_mps", "m/s", "walking speed; 0 stands", &WalkOptions::speed_mps, 0, 1.2},
    Row{"robot.speed_variation", "1", "how much the speed wanders, relative",
        &WalkOptions::speed_variation, 0, 0.5},
    Row{"robot.yaw_rate_radps", "rad/s", "fastest turning", &WalkOptions::yaw_rate_radps, 0.1, 1.5},
    Row{"robot.stand_s", "s", "standing before the first step", &WalkOptions::stand_s, 0, 600},
    Row{"robot.pause_interval_s", "s", "walking between pauses, on average; 0 never pauses",
        &WalkOptions::pause_interval_s, 0, 3600},
    Row{"robot.pause_s", "s", "length of a pause, on average", &WalkOptions::pause_s, 0, 60},
    Row{"robot.gait_hz", "Hz", "strides a second", &WalkOptions::gait_hz, 1.5, 3},
    Row{"robot.gait_variation", "1", "how much the stride frequency wanders, relative",
        &WalkOptions::gait_variation, 0, 0.1},
    Row{"robot.duty", "1", "share of a stride that a foot is on the ground", &WalkOptions::duty,
        0.53, 0.75},
    Row{"robot.jitter", "1",
        "amplitude of the body's motion with the gait; 1 as measured, 1.25 pronounced",
        &WalkOptions::jitter, 0, 2},
    Row{"robot.jitter_variation", "1",
        "how much that amplitude differs from step to step, relative",
        &WalkOptions::jitter_variation, 0, 0.5},
    Row{"robot.wander", "1", "slow changes of posture; 1 as measured", &WalkOptions::wander, 0, 3},
    Row{"robot.body_height_m", "m", "base over the floor", &WalkOptions::body_height_m, 0.22, 0.36},
    Row{"robot.step_height_m", "m", "how high a foot is lifted", &WalkOptions::step_height_m, 0.02,
        0.12},
    Row{"robot.touchdown_mps", "m/s", "downward speed of a foot that lands",
        &WalkOptions::touchdown_mps, 0, 0.6},
    Row{"robot.foothold_noise_m", "m", "how far a foot lands from its planned place",
        &WalkOptions::foothold_noise_m, 0, 0.03},
    Row{"robot.rolling_radius_m", "m", "radius on which a foot rolls in stance; 0 does not roll",
        &WalkOptions::rolling_radius_m, 0, 0.022},
    Row{"robot.slip_probability", "1", "share of steps in which the foot slips",
        &WalkOptions::slip_probability, 0, 1},
    Row{"robot.slip_length_m", "m", "how far it slips then, on average",
        &WalkOptions::slip_length_m, 0, 0.08},
    Row{"robot.ground_sink_m", "m", "how deep soft ground gives in under a foot; 0 is hard",
        &WalkOptions::ground_sink_m, 0, 0.03}};
// NOLINTEND(readability-magic-numbers)

/// Real Go1 at its usual trot makes 1.5 strides a second; learnt trots make 2 to 4.
constexpr double kPronouncedGaitHz = 3;
constexpr double kPronouncedJitter = 1.25;

}  // namespace

std::span<const Knob<WalkOptions>> walk_knobs() {
  return kRows;
}

WalkOptions with_pronounced_trot(WalkOptions options) {
  options.gait_hz = kPronouncedGaitHz;
  options.jitter = kPronouncedJitter;
  return options;
}

}  // namespace geoflow::simulator
