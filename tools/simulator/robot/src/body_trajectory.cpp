#include "geoflow/tools/simulator/body_trajectory.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/smooth_signal.hpp"

namespace geoflow::simulator {
namespace {

/// What remains of the slow wandering while the robot stands: its balance control holds it.
constexpr double kStandingWander = 0.02;

struct Attitude {
  Jet roll, pitch, yaw;
};

SE3 placed(const Vector3d& position, double yaw, double pitch, double roll) {
  return SE3{Eigen::Quaterniond{Eigen::AngleAxisd{yaw, Vector3d::UnitZ()} *
                                Eigen::AngleAxisd{pitch, Vector3d::UnitY()} *
                                Eigen::AngleAxisd{roll, Vector3d::UnitX()}},
             position};
}

/// The body's rates for yaw, pitch, roll about z, y', x'', and their derivative.
void set_angular_motion(const Attitude& attitude, BodyState& state) {
  const double sin_roll = std::sin(attitude.roll.value);
  const double cos_roll = std::cos(attitude.roll.value);
  const double sin_pitch = std::sin(attitude.pitch.value);
  const double cos_pitch = std::cos(attitude.pitch.value);
  const double roll_rate = attitude.roll.rate;
  const double pitch_rate = attitude.pitch.rate;
  const double yaw_rate = attitude.yaw.rate;
  state.w_base = {roll_rate - yaw_rate * sin_pitch,
                  pitch_rate * cos_roll + yaw_rate * cos_pitch * sin_roll,
                  -pitch_rate * sin_roll + yaw_rate * cos_pitch * cos_roll};
  // How the yaw rate's share along the roll-free y and z axes changes with pitch.
  const double yaw_accel_level = attitude.yaw.accel * cos_pitch - yaw_rate * pitch_rate * sin_pitch;
  state.alpha_base = {
      attitude.roll.accel - attitude.yaw.accel * sin_pitch - yaw_rate * pitch_rate * cos_pitch,
      attitude.pitch.accel * cos_roll + yaw_accel_level * sin_roll + roll_rate * state.w_base.z(),
      -attitude.pitch.accel * sin_roll + yaw_accel_level * cos_roll - roll_rate * state.w_base.y()};
}

}  // namespace

BodyState BodyTrajectory::at(double t_s) const {
  const Jet phase = 2 * std::numbers::pi * plan_.phase.at(t_s);
  const Jet activity = plan_.activity.at(t_s);
  std::array<Jet, kBodyAxes> axis{};
  SmoothWeights gain_weights{t_s, 1};
  SmoothWeights phase_weights{t_s, 1};
  for (const BodyOscillation& line : plan_.oscillations) {
    const Jet angle =
        line.harmonic * phase + constant(line.offset_rad) + line.phase_noise.at(phase_weights);
    Jet& sum = axis.at(static_cast<std::size_t>(line.axis));
    sum = sum + line.amplitude * (activity * line.gain.at(gain_weights) * cos(angle));
  }
  const Jet wandering = constant(kStandingWander) + (1 - kStandingWander) * activity;
  for (const BodyWander& wander : plan_.wanders) {
    Jet& sum = axis.at(static_cast<std::size_t>(wander.axis));
    sum = sum + wander.amplitude * (wandering * wander.signal.at(t_s));
  }

  const auto& [surge, sway, bob, roll, pitch, yaw_offset] = axis;
  const Jet heading = plan_.yaw_rad.at(t_s);
  const Jet x = plan_.x_m.at(t_s) + surge * cos(heading) - sway * sin(heading);
  const Jet y = plan_.y_m.at(t_s) + surge * sin(heading) + sway * cos(heading);
  const Jet z = constant(plan_.height_m) + bob;
  const Attitude attitude{.roll = roll, .pitch = pitch, .yaw = heading + yaw_offset};

  BodyState state;
  state.T_world_base =
      placed({x.value, y.value, z.value}, attitude.yaw.value, pitch.value, roll.value);
  state.v_world_base = {x.rate, y.rate, z.rate};
  state.a_world_base = {x.accel, y.accel, z.accel};
  set_angular_motion(attitude, state);
  return state;
}

SE3 BodyTrajectory::planned(double t_s) const {
  return placed({plan_.x_m.at(t_s).value, plan_.y_m.at(t_s).value, 0}, plan_.yaw_rad.at(t_s).value,
                0, 0);
}

double BodyTrajectory::time_of_phase(double phase) const {
  constexpr int kHalvings = 60;  // beyond a double's digits
  double low = 0;
  double high = plan_.duration_s + 1;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (plan_.phase.at(middle).value < phase ? low : high) = middle;
  }
  return high;
}

}  // namespace geoflow::simulator
