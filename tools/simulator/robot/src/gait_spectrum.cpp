#include "src/gait_spectrum.hpp"

#include <array>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/smooth_signal.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::simulator {
namespace {

struct Line {
  BodyAxis axis;
  double harmonic;
  double amplitude;   ///< at kReferenceHz [m] or [rad]
  double peak_phase;  ///< in strides: where the acceleration has its positive peak
};

constexpr double kReferenceHz = 2;

// NOLINTBEGIN(readability-magic-numbers): the table of measured lines

/// Amplitudes between those of a physics simulation of the Go2 (trot at 2 Hz, 0.19 and 0.36 m/s)
/// and those of a real Go1's body IMU (trot at 1.65 Hz, 0.2 m/s), both taken from the spectra of
/// their accelerometer and gyroscope and integrated. Where the real robot's are much greater (sway,
/// the odd lines of a slight limp, roll and yaw) they are nearer to its. Bob peaks upwards just
/// after a pair of feet lands (phases 0 and 1/2), as in both.
constexpr std::array kLines{
    Line{.axis = BodyAxis::kBob, .harmonic = 1, .amplitude = 0.6e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kBob, .harmonic = 2, .amplitude = 3.0e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kBob, .harmonic = 4, .amplitude = 0.85e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kBob, .harmonic = 6, .amplitude = 0.24e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kSurge, .harmonic = 1, .amplitude = 2.0e-3, .peak_phase = 0.3},
    Line{.axis = BodyAxis::kSurge, .harmonic = 2, .amplitude = 1.8e-3, .peak_phase = 0.15},
    Line{.axis = BodyAxis::kSurge, .harmonic = 4, .amplitude = 0.3e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kSurge, .harmonic = 6, .amplitude = 0.08e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kSway, .harmonic = 1, .amplitude = 6.0e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kSway, .harmonic = 3, .amplitude = 0.3e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kSway, .harmonic = 5, .amplitude = 0.05e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kRoll, .harmonic = 1, .amplitude = 6.0e-3, .peak_phase = 0.3},
    Line{.axis = BodyAxis::kRoll, .harmonic = 2, .amplitude = 5.5e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kRoll, .harmonic = 3, .amplitude = 4.5e-3, .peak_phase = 0.2},
    Line{.axis = BodyAxis::kRoll, .harmonic = 5, .amplitude = 2.2e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kRoll, .harmonic = 7, .amplitude = 1.3e-3, .peak_phase = 0.03},
    Line{.axis = BodyAxis::kPitch, .harmonic = 1, .amplitude = 4.0e-3, .peak_phase = 0.15},
    Line{.axis = BodyAxis::kPitch, .harmonic = 2, .amplitude = 7.0e-3, .peak_phase = 0.2},
    Line{.axis = BodyAxis::kPitch, .harmonic = 4, .amplitude = 2.0e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kPitch, .harmonic = 6, .amplitude = 0.8e-3, .peak_phase = 0.05},
    Line{.axis = BodyAxis::kYaw, .harmonic = 1, .amplitude = 18e-3, .peak_phase = 0.2},
    Line{.axis = BodyAxis::kYaw, .harmonic = 3, .amplitude = 2.5e-3, .peak_phase = 0.1},
    Line{.axis = BodyAxis::kYaw, .harmonic = 5, .amplitude = 0.6e-3, .peak_phase = 0.05}};

struct Wander {
  BodyAxis axis;
  double amplitude;  ///< standard deviation [m] or [rad]
};

/// Of the same Go1's motion capture: height 4 to 8 mm, roll and pitch 0.9 to 1.6 degrees over 6 s.
constexpr std::array kWanders{Wander{.axis = BodyAxis::kSway, .amplitude = 8e-3},
                              Wander{.axis = BodyAxis::kBob, .amplitude = 4e-3},
                              Wander{.axis = BodyAxis::kRoll, .amplitude = 12e-3},
                              Wander{.axis = BodyAxis::kPitch, .amplitude = 16e-3},
                              Wander{.axis = BodyAxis::kYaw, .amplitude = 20e-3}};

/// Slower than a step.
constexpr double kWanderSpacingS = 0.8;
/// How far a line's phase wanders [rad].
constexpr double kPhaseDeviation = 0.15;

// NOLINTEND(readability-magic-numbers)

}  // namespace

std::vector<BodyOscillation> gait_oscillations(const WalkOptions& options) {
  const double step_s = 0.5 / options.gait_hz;
  std::vector<BodyOscillation> oscillations;
  for (const Line& line : kLines) {
    const std::string name = fmt::format("{}.{}", static_cast<int>(line.axis), line.harmonic);
    const SmoothSignal variation = SmoothSignal::noise(
        RandomStream{options.seed, "robot.gain." + name}, step_s, options.duration_s);
    // Amplitudes fall with the frequency so that accelerations grow with it, not with its square:
    // the legs' springs give what the time allows.
    const double amplitude = options.jitter * line.amplitude * kReferenceHz / options.gait_hz;
    oscillations.push_back(
        {.axis = line.axis,
         .harmonic = line.harmonic,
         .amplitude = amplitude,
         .offset_rad = std::numbers::pi * (1 - 2 * line.harmonic * line.peak_phase),
         .gain = variation.affine(options.jitter_variation, 1),
         .phase_noise = SmoothSignal::noise(RandomStream{options.seed, "robot.phase." + name},
                                            2 * step_s, options.duration_s)
                            .affine(kPhaseDeviation, 0)});
  }
  return oscillations;
}

std::vector<BodyWander> body_wanders(const WalkOptions& options) {
  std::vector<BodyWander> wanders;
  for (const Wander& wander : kWanders) {
    const std::string name = fmt::format("robot.wander.{}", static_cast<int>(wander.axis));
    wanders.push_back({.axis = wander.axis,
                       .amplitude = options.wander * wander.amplitude,
                       .signal = SmoothSignal::noise(RandomStream{options.seed, name},
                                                     kWanderSpacingS, options.duration_s)});
  }
  return wanders;
}

}  // namespace geoflow::simulator
