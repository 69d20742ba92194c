#include "src/stance_motion.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::simulator {
namespace {

/// Steps of the integration: with the body's fastest line (12 to 18 Hz, under a milliradian)
/// interpolating between them keeps a foot's way to a nanometre.
constexpr double kNodeSpacingS = 4e-3;

/// Soft ground gives in over this share of a stance, and comes back over the same share at its end.
constexpr double kSinkingShare = 0.3;

/// From 0 to 1 with two continuous derivatives, and its derivative by u.
struct Ramp {
  double value = 0;
  double rate = 0;
};
Ramp ramp(double u) {
  u = std::clamp(u, 0.0, 1.0);
  // NOLINTBEGIN(readability-magic-numbers): the quintic smoothstep
  return {.value = u * u * u * (10 + u * (6 * u - 15)), .rate = 30 * u * u * (1 - u) * (1 - u)};
  // NOLINTEND(readability-magic-numbers)
}

/// A stance of one leg on a moving body.
struct Rolling {
  const WalkOptions& options;
  Leg leg;
  const Stance& stance;

  /// Velocity of the sphere's centre over the floor when it is at `centre`.
  [[nodiscard]] std::optional<Vector2d> rate(const BodyState& body, const Vector2d& centre,
                                             double t_s) const {
    const CentreHeight height = centre_height(stance, options.ground_sink_m, t_s);
    const Vector2d slip = slip_rate(stance, t_s);
    const auto motion =
        rolling_motion(body, leg, {centre.x(), centre.y(), height.height_m},
                       {slip.x(), slip.y(), height.rate_mps}, options.rolling_radius_m);
    if (!motion) {
      return std::nullopt;
    }
    return motion->centre_rate_world.head<2>();
  }
};

}  // namespace

std::optional<Vector3d> joint_angles_of_centre(const LegGeometry& geometry, Leg leg,
                                               const Vector3d& centre_in_base) {
  // The centre lies beside the calf's axis: a longer calf at a slightly other angle reaches it.
  LegGeometry to_centre = geometry;
  to_centre.calf_m = std::hypot(geometry.calf_m, geometry.foot_offset_m);
  to_centre.foot_offset_m = 0;
  const double beside = std::asin(-geometry.foot_offset_m / to_centre.calf_m);
  std::optional<Vector3d> q = joint_angles(to_centre, leg, centre_in_base);
  if (q) {
    q->z() -= beside;
  }
  return q;
}

std::optional<RollingMotion> rolling_motion(const BodyState& body, Leg leg,
                                            const Vector3d& centre_world,
                                            const Vector3d& contact_mps, double rolling_radius_m) {
  const Vector3d centre = body.T_world_base.inverse() * centre_world;
  const std::optional<Vector3d> q = joint_angles_of_centre(kGo2Legs, leg, centre);
  if (!q) {
    return std::nullopt;
  }
  const Matrix3d R_world_base = body.T_world_base.rotation_matrix();
  const Vector3d up_in_base = R_world_base.transpose() * Vector3d::UnitZ();
  const FootContact touching = foot_contact(kGo2Legs, leg, *q, up_in_base, rolling_radius_m);
  const FootContact middle = foot_contact(kGo2Legs, leg, *q, up_in_base, 0);
  const Vector3d relative = R_world_base.transpose() * (contact_mps - body.v_world_base) -
                            body.w_base.cross(touching.point);
  const Vector3d dq = touching.jacobian.inverse() * relative;
  if (!dq.allFinite()) {
    return std::nullopt;
  }
  return RollingMotion{
      .joints = {.q_rad = *q, .dq_radps = dq},
      .centre_rate_world = body.v_world_base +
                           R_world_base * (middle.jacobian * dq + body.w_base.cross(middle.point))};
}

Vector2d slip_rate(const Stance& stance, double t_s) {
  for (const Slip& slip : stance.slips) {
    if (t_s > slip.start_s && t_s < slip.end_s) {
      const double length_s = slip.end_s - slip.start_s;
      return ramp((t_s - slip.start_s) / length_s).rate / length_s * slip.way_world;
    }
  }
  return Vector2d::Zero();
}

CentreHeight centre_height(const Stance& stance, double ground_sink_m, double t_s) {
  const double share_s = kSinkingShare * (stance.liftoff_s - stance.touchdown_s);
  const Ramp down = ramp((t_s - stance.touchdown_s) / share_s);
  const Ramp up = ramp((t_s - (stance.liftoff_s - share_s)) / share_s);
  return {.height_m = kGo2Legs.foot_radius_m - ground_sink_m * (down.value - up.value),
          .rate_mps = -ground_sink_m * (down.rate - up.rate) / share_s};
}

bool roll_through(const BodyTrajectory& body, const WalkOptions& options, Leg leg,
                  const Vector2d& centre_world, Stance& stance) {
  const Rolling rolling{.options = options, .leg = leg, .stance = stance};
  Vector2d centre = centre_world;
  stance.centre_world = {centre};
  stance.centre_rate_world = {Vector2d::Zero()};
  if (options.rolling_radius_m == 0 && stance.slips.empty()) {
    return true;
  }
  stance.node_spacing_s = kNodeSpacingS;
  stance.centre_rate_world.clear();
  const double end_s = std::min(stance.liftoff_s, body.duration_s()) + kNodeSpacingS;
  BodyState now = body.at(stance.touchdown_s);
  for (double t_s = stance.touchdown_s;; t_s += kNodeSpacingS) {
    const auto k1 = rolling.rate(now, centre, t_s);
    if (!k1) {
      return false;
    }
    stance.centre_rate_world.push_back(*k1);
    if (t_s >= end_s && stance.centre_world.size() > 1) {
      return true;
    }
    const double middle_s = t_s + kNodeSpacingS / 2;
    const BodyState middle = body.at(middle_s);
    now = body.at(t_s + kNodeSpacingS);
    const auto k2 = rolling.rate(middle, centre + kNodeSpacingS / 2 * *k1, middle_s);
    const auto k3 = k2 ? rolling.rate(middle, centre + kNodeSpacingS / 2 * *k2, middle_s) : k2;
    const auto k4 = k3 ? rolling.rate(now, centre + kNodeSpacingS * *k3, t_s + kNodeSpacingS) : k3;
    if (!k4) {
      return false;
    }
    // NOLINTNEXTLINE(readability-magic-numbers): the classical Runge-Kutta method
    centre += kNodeSpacingS / 6 * (*k1 + 2 * *k2 + 2 * *k3 + *k4);
    stance.centre_world.push_back(centre);
  }
}

}  // namespace geoflow::simulator
