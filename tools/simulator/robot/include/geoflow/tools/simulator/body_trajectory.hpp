#pragma once

#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/smooth_signal.hpp"

namespace geoflow::simulator {

/// The robot's body at one instant. World: z up, floor at z = 0.
struct BodyState {
  SE3 T_world_base;
  Vector3d v_world_base = Vector3d::Zero();  ///< of base's origin, in world [m/s]
  Vector3d a_world_base = Vector3d::Zero();  ///< likewise [m/s^2]; gravity is not in it
  Vector3d w_base = Vector3d::Zero();        ///< angular velocity in base [rad/s]
  Vector3d alpha_base = Vector3d::Zero();    ///< its derivative in base [rad/s^2]
};

/// A degree of freedom of the body about its planned way: offsets along the heading's axes [m] and
/// roll, pitch, yaw [rad].
enum class BodyAxis : unsigned char { kSurge, kSway, kBob, kRoll, kPitch, kYaw };
inline constexpr unsigned kBodyAxes = 6;

/// amplitude * gain(t) * cos(2 pi harmonic phase(t) + offset + phase_noise(t)): one line of the
/// gait's spectrum.
struct BodyOscillation {
  BodyAxis axis = BodyAxis::kBob;
  double harmonic = 1;   ///< of the stride frequency
  double amplitude = 0;  ///< [m] or [rad]
  double offset_rad = 0;
  SmoothSignal gain{};         ///< how it varies from step to step; 1 on average while walking
  SmoothSignal phase_noise{};  ///< [rad]
};

/// A slow wandering of one axis that has nothing to do with the steps.
struct BodyWander {
  BodyAxis axis = BodyAxis::kBob;
  double amplitude = 0;  ///< standard deviation [m] or [rad]
  SmoothSignal signal{};
};

/// Where the body goes on the floor, and the gait's clock.
struct BodyPlan {
  double duration_s = 0;
  double height_m = 0;  ///< of base over the floor
  SmoothSignal x_m{};
  SmoothSignal y_m{};
  SmoothSignal yaw_rad{};   ///< the heading, not wrapped
  SmoothSignal phase{};     ///< strides since the start; grows
  SmoothSignal activity{};  ///< 0 standing to 1 walking
  std::vector<BodyOscillation> oscillations{};
  std::vector<BodyWander> wanders{};
};

/// The body's motion with its exact first and second derivatives: a planned way on the floor, with
/// the gait's oscillations and slow wandering upon it. Four times continuously differentiable.
/// Const calls are thread-safe.
class BodyTrajectory {
 public:
  explicit BodyTrajectory(BodyPlan plan) : plan_{std::move(plan)} {}

  /// Defined from 0 to duration_s(), and smoothly somewhat beyond.
  [[nodiscard]] BodyState at(double t_s) const;
  [[nodiscard]] double duration_s() const noexcept { return plan_.duration_s; }

  /// Without gait and wandering: place on the floor and heading only.
  [[nodiscard]] SE3 planned(double t_s) const;

  /// Strides since the start.
  [[nodiscard]] double phase(double t_s) const { return plan_.phase.at(t_s).value; }
  /// The first time at which `phase(t)` is `phase`, searched in [0, duration_s() + a stride].
  [[nodiscard]] double time_of_phase(double phase) const;

 private:
  BodyPlan plan_;
};

}  // namespace geoflow::simulator
