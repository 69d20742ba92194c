#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::simulator {

/// Every leg in the order of `Leg`.
inline constexpr std::array kAllLegs{Leg::kFrontRight, Leg::kFrontLeft, Leg::kRearRight,
                                     Leg::kRearLeft};

/// A foot sliding over the floor while it carries.
struct Slip {
  double start_s = 0;
  double end_s = 0;
  Vector2d way_world = Vector2d::Zero();  ///< from its start to its end [m]
};

/// One foot's time on the ground.
struct Stance {
  double touchdown_s = 0;  ///< before 0 for the stance that the walk begins with
  double liftoff_s = 0;    ///< beyond the duration for the one that it ends with
  std::vector<Slip> slips{};

  /// The way of the sphere's centre over the floor at steps of `node_spacing_s` from touchdown; one
  /// node if it does not move.
  double node_spacing_s = 0;
  std::vector<Vector2d> centre_world{};
  std::vector<Vector2d> centre_rate_world{};  ///< its velocity [m/s]
};

/// One foot at one instant. "Foot" is the centre of the sphere at the leg's end.
struct FootState {
  Vector3d p_world = Vector3d::Zero();
  Vector3d v_world = Vector3d::Zero();  ///< [m/s]; not zero in stance when the foot rolls
  Vector3d a_world = Vector3d::Zero();  ///< [m/s^2]; of the swing, zero in stance
  bool contact = false;
  /// Velocity of the material point that touches the ground, in world [m/s]: zero unless the foot
  /// slips or the ground gives in.
  Vector3d contact_mps = Vector3d::Zero();
  bool slipping = false;
  /// How much of its share of the weight it carries: rises from 0 after touchdown to 1, falls
  /// before liftoff.
  double load = 0;
};

/// One leg's joints at one instant (hip, thigh, calf) [rad], [rad/s].
struct LegMotion {
  Vector3d q_rad = Vector3d::Zero();
  Vector3d dq_radps = Vector3d::Zero();
};

/// The whole robot at one instant; feet and legs in the order of `Leg`.
struct RobotState {
  BodyState body;
  std::array<FootState, kLegCount> feet{};
  std::array<LegMotion, kLegCount> legs{};
};

/// A planned walk: the body's motion and every foot's. Const calls are thread-safe.
class Walk {
 public:
  [[nodiscard]] const BodyTrajectory& body() const noexcept { return body_; }
  [[nodiscard]] double duration_s() const noexcept { return body_.duration_s(); }
  [[nodiscard]] const WalkOptions& options() const noexcept { return options_; }
  [[nodiscard]] const LegGeometry& geometry() const noexcept { return kGo2Legs; }

  /// In order of time, at least one a leg; in between the foot swings.
  [[nodiscard]] std::span<const Stance> stances(Leg leg) const noexcept {
    return stances_[static_cast<std::size_t>(leg)];
  }

  /// Body, feet and joints at a time from 0 to duration_s(). Joints are those that put each foot
  /// where it is, by inverse kinematics, with their exact rates.
  [[nodiscard]] RobotState state(double t_s) const;

 private:
  friend Result<Walk> plan_walk(std::span<const Vector2d> waypoints_world,
                                const WalkOptions& options);
  Walk(BodyTrajectory body, const WalkOptions& options)
      : body_{std::move(body)}, options_{options} {}

  BodyTrajectory body_;
  WalkOptions options_;
  std::array<std::vector<Stance>, kLegCount> stances_{};
};

/// A trot along the polyline `waypoints_world` [m] on flat floor z = 0, as `options` say: standing
/// first, then walking the line smoothly, slower in bends and turning on the spot at sharp corners,
/// round and round if the last waypoint is the first, else back and forth, until the duration is
/// over. The body stays on the line to within a few centimetres. Errors (kInvalidArgument): fewer
/// than two different waypoints, a coordinate that is no number, a duration that is not positive,
/// or steps that the legs cannot make, which names the knobs to change.
[[nodiscard]] Result<Walk> plan_walk(std::span<const Vector2d> waypoints_world,
                                     const WalkOptions& options);

}  // namespace geoflow::simulator
