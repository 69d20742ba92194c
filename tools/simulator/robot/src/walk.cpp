#include "geoflow/tools/simulator/walk.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/smooth_signal.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

#include "src/stance_motion.hpp"

namespace geoflow::simulator {
namespace {

/// A foot takes its share of the weight over, and gives it up again, within this time, or this part
/// of a short stance.
constexpr double kLoadingS = 0.03;
constexpr double kLoadingShare = 0.25;

/// A foot slides when its contact point is faster than this [m/s].
constexpr double kSlippingMps = 1e-3;

double smooth_step(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * (3 - 2 * u);
}

double load_of(const Stance& stance, double t_s) {
  const double loading_s =
      std::min(kLoadingS, kLoadingShare * (stance.liftoff_s - stance.touchdown_s));
  return smooth_step((t_s - stance.touchdown_s) / loading_s) *
         smooth_step((stance.liftoff_s - t_s) / loading_s);
}

/// The sphere's centre over the floor: cubic Hermite interpolation of the stance's nodes.
Vector2d centre_at(const Stance& stance, double t_s) {
  if (stance.centre_world.size() == 1) {
    return stance.centre_world.front();
  }
  const double place = std::clamp((t_s - stance.touchdown_s) / stance.node_spacing_s, 0.0,
                                  static_cast<double>(stance.centre_world.size() - 1));
  const auto node = std::min(static_cast<std::size_t>(place), stance.centre_world.size() - 2);
  const double u = place - static_cast<double>(node);
  const double v = 1 - u;
  return v * v * (1 + 2 * u) * stance.centre_world[node] +
         u * u * (1 + 2 * v) * stance.centre_world[node + 1] +
         stance.node_spacing_s * u * v *
             (v * stance.centre_rate_world[node] - u * stance.centre_rate_world[node + 1]);
}

/// A foot and its leg's joints.
struct PlacedLeg {
  FootState foot;
  LegMotion joints;
};

PlacedLeg standing_leg(const BodyState& body, const WalkOptions& options, const Stance& stance,
                       Leg leg, double t_s) {
  PlacedLeg placed;
  FootState& foot = placed.foot;
  const Vector2d centre = centre_at(stance, t_s);
  const CentreHeight height = centre_height(stance, options.ground_sink_m, t_s);
  const Vector2d slip = slip_rate(stance, t_s);
  foot.p_world = {centre.x(), centre.y(), height.height_m};
  foot.contact = true;
  foot.contact_mps = {slip.x(), slip.y(), height.rate_mps};
  foot.slipping = slip.norm() > kSlippingMps;
  foot.load = load_of(stance, t_s);
  // plan_walk() has seen that every step is reached.
  if (const auto motion =
          rolling_motion(body, leg, foot.p_world, foot.contact_mps, options.rolling_radius_m)) {
    foot.v_world = motion->centre_rate_world;
    placed.joints = motion->joints;
  }
  return placed;
}

/// From rest of the contact to the next foothold: a quintic over the floor, and a lift that comes
/// down with the landing speed.
// NOLINTBEGIN(readability-magic-numbers): coefficients of the quintic and of the lift's polynomials
FootState swinging_foot(const WalkOptions& options, const Stance& before, const Stance& after,
                        double t_s) {
  const double length_s = after.touchdown_s - before.liftoff_s;
  const double u = (t_s - before.liftoff_s) / length_s;
  const double u2 = u * u;
  // Quintic with position, velocity and no acceleration at the start, and rest at the end.
  const Jet to_end{.value = u2 * u * (10 + u * (6 * u - 15)),
                   .rate = 30 * u2 * (1 - u) * (1 - u),
                   .accel = 60 * u * (1 - u) * (1 - 2 * u)};
  const Jet leave{.value = u * (1 + u2 * (-6 + u * (8 - 3 * u))),
                  .rate = 1 + u2 * (-18 + u * (32 - 15 * u)),
                  .accel = u * (-36 + u * (96 - 60 * u))};
  const double v = u * (1 - u);
  const double v_rate = 1 - 2 * u;
  const Jet lift{.value = 64 * v * v * v,
                 .rate = 192 * v * v * v_rate,
                 .accel = 384 * v * v_rate * v_rate - 384 * v * v};
  const Jet landing{.value = u2 * u * (1 - u), .rate = u2 * (3 - 4 * u), .accel = u * (6 - 12 * u)};
  const Vector2d start = centre_at(before, before.liftoff_s);
  const Vector2d way_over_floor = after.centre_world.front() - start;
  const Vector2d left_with = before.centre_rate_world.back() * length_s;
  const Vector3d way{way_over_floor.x(), way_over_floor.y(), 0};
  const Vector3d leaving{left_with.x(), left_with.y(), 0};
  const Vector3d up = Vector3d::UnitZ();
  const double height_m = options.step_height_m;
  const double landing_m = options.touchdown_mps * length_s;
  FootState foot;
  foot.p_world = Vector3d{start.x(), start.y(), kGo2Legs.foot_radius_m} + to_end.value * way +
                 leave.value * leaving + (height_m * lift.value + landing_m * landing.value) * up;
  foot.v_world = (to_end.rate * way + leave.rate * leaving +
                  (height_m * lift.rate + landing_m * landing.rate) * up) /
                 length_s;
  foot.a_world = (to_end.accel * way + leave.accel * leaving +
                  (height_m * lift.accel + landing_m * landing.accel) * up) /
                 (length_s * length_s);
  return foot;
}
// NOLINTEND(readability-magic-numbers)

}  // namespace

RobotState Walk::state(double t_s) const {
  RobotState state;
  state.body = body_.at(t_s);
  for (const Leg leg : kAllLegs) {
    const auto l = static_cast<std::size_t>(leg);
    const std::vector<Stance>& stances = stances_.at(l);
    const auto after = std::ranges::partition_point(
        stances, [&](const Stance& stance) { return stance.touchdown_s <= t_s; });
    const Stance& stance = after == stances.begin() ? *after : *std::prev(after);
    PlacedLeg placed;
    if (t_s < stance.liftoff_s || after == stances.end()) {
      placed = standing_leg(state.body, options_, stance, leg, t_s);
    } else {
      placed.foot = swinging_foot(options_, stance, *after, t_s);
      if (const auto motion =
              rolling_motion(state.body, leg, placed.foot.p_world, placed.foot.v_world, 0)) {
        placed.joints = motion->joints;
      }
    }
    state.feet.at(l) = placed.foot;
    state.legs.at(l) = placed.joints;
  }
  return state;
}

}  // namespace geoflow::simulator
