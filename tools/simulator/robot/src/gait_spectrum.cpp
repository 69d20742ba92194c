#include "src/gait_spectrum.hpp"

#include <array>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

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
    Line{BodyAxis::kBob, 1, 0.6e-3, 0.05},   Line{BodyAxis::kBob, 2, 3.0e-3, 0.05},
    Line{BodyAxis::kBob, 4, 0.85e-3, 0.05},  Line{BodyAxis::kBob, 6, 0.24e-3, 0.05},
    Line{BodyAxis::kSurge, 1, 2.0e-3, 0.3},  Line{BodyAxis::kSurge, 2, 1.8e-3, 0.15},
    Line{BodyAxis::kSurge, 4, 0.3e-3, 0.1},  Line{BodyAxis::kSurge, 6, 0.08e-3, 0.1},
    Line{BodyAxis::kSway, 1, 6.0e-3, 0.05},  Line{BodyAxis::kSway, 3, 0.3e-3, 0.05},
    Line{BodyAxis::kSway, 5, 0.05e-3, 0.05}, Line{BodyAxis::kRoll, 1, 6.0e-3, 0.3},
    Line{BodyAxis::kRoll, 2, 5.5e-3, 0.1},   Line{BodyAxis::kRoll, 3, 4.5e-3, 0.2},
    Line{BodyAxis::kRoll, 5, 2.2e-3, 0.1},   Line{BodyAxis::kRoll, 7, 1.3e-3, 0.03},
    Line{BodyAxis::kPitch, 1, 4.0e-3, 0.15}, Line{BodyAxis::kPitch, 2, 7.0e-3, 0.2},
    Line{BodyAxis::kPitch, 4, 2.0e-3, 0.1},  Line{BodyAxis::kPitch, 6, 0.8e-3, 0.05},
    Line{BodyAxis::kYaw, 1, 18e-3, 0.2},     Line{BodyAxis::kYaw, 3, 2.5e-3, 0.1},
    Line{BodyAxis::kYaw, 5, 0.6e-3, 0.05}};

struct Wander {
  BodyAxis axis;
  double amplitude;  ///< standard deviation [m] or [rad]
};

/// Of the same Go1's motion capture: height 4 to 8 mm, roll and pitch 0.9 to 1.6 degrees over 6 s.
constexpr std::array kWanders{Wander{BodyAxis::kSway, 8e-3}, Wander{BodyAxis::kBob, 4e-3},
                              Wander{BodyAxis::kRoll, 12e-3}, Wander{BodyAxis::kPitch, 16e-3},
                              Wander{BodyAxis::kYaw, 20e-3}};

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
