#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/smooth_signal.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

#include "src/footsteps.hpp"
#include "src/gait_spectrum.hpp"
#include "src/path_walker.hpp"
#include "src/stance_motion.hpp"

namespace geoflow::simulator {
namespace {

/// Between the controls of the planned way: the smoothing is three of them to each side.
constexpr double kControlSpacingS = 0.1;
/// A swing that is under way at the end of the walk lands within this time.
constexpr double kLastSwingS = 0.5;
/// Every swing is looked at this often whether the leg reaches.
constexpr double kReachCheckS = 0.01;

/// The times in which the gait has to run, and its activity: wherever the walker moves, and as long
/// before and after as the smoothing lets the body move.
std::vector<GaitInterval> gait_intervals(const std::vector<bool>& moving, double duration_s) {
  std::vector<GaitInterval> intervals;
  for (std::size_t i = 0; i < moving.size(); ++i) {
    if (!moving[i]) {
      continue;
    }
    const auto reach = static_cast<double>(kSmoothSignalReach);
    const double start_s = (static_cast<double>(i) - reach) * kControlSpacingS;
    const double end_s =
        std::min((static_cast<double>(i) + reach) * kControlSpacingS, duration_s + kLastSwingS);
    if (!intervals.empty() && start_s <= intervals.back().end_s) {
      intervals.back().end_s = end_s;
    } else {
      intervals.push_back({.start_s = std::max(start_s, 0.0), .end_s = end_s});
    }
  }
  return intervals;
}

SmoothSignal activity(std::span<const GaitInterval> gait, std::size_t count) {
  std::vector<double> controls(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double t_s = static_cast<double>(i) * kControlSpacingS;
    controls[i] = static_cast<double>(std::ranges::any_of(gait, [&](const GaitInterval& interval) {
      return t_s >= interval.start_s && t_s <= interval.end_s;
    }));
  }
  return SmoothSignal{kControlSpacingS, std::move(controls)};
}

/// The gait's clock: strides since the start, at a frequency that wanders about the wanted one.
SmoothSignal gait_phase(const WalkOptions& options, std::size_t count) {
  constexpr double kWanderSpacingS = 0.5;
  constexpr double kSlowest = 0.7;  // of the wanted frequency: the clock always goes forward
  const SmoothSignal wander =
      SmoothSignal::noise(RandomStream{options.seed, "robot.gait_clock"}, kWanderSpacingS,
                          static_cast<double>(count) * kControlSpacingS);
  std::vector<double> controls(count);
  double phase = 0;
  for (std::size_t i = 0; i < count; ++i) {
    controls[i] = phase;
    const double relative =
        1 + options.gait_variation * wander.at(static_cast<double>(i) * kControlSpacingS).value;
    phase += options.gait_hz * std::max(relative, kSlowest) * kControlSpacingS;
  }
  return SmoothSignal{kControlSpacingS, std::move(controls)};
}

Result<void> check_arguments(std::span<const Vector2d> waypoints, const WalkOptions& options) {
  if (!(options.duration_s > 0) || !std::isfinite(options.duration_s)) {
    return fail(ErrorCode::kInvalidArgument, "robot: duration {} s is not positive",
                options.duration_s);
  }
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    if (!waypoints[i].allFinite()) {
      return fail(ErrorCode::kInvalidArgument, "robot: waypoint {} is not a point", i);
    }
  }
  for (const Knob<WalkOptions>& knob : walk_knobs()) {
    const double value = knob_value(knob, options);
    if (!(value >= knob.minimum && value <= knob.maximum)) {
      return fail(ErrorCode::kInvalidArgument, "{}: {} is outside {} to {} {}", knob.name, value,
                  knob.minimum, knob.maximum, knob.unit);
    }
  }
  return {};
}

/// A stance integrates what it rolls, and so knows that it is reached; swings are looked at here.
Result<void> check_reach(const Walk& walk) {
  const auto count = static_cast<std::size_t>(walk.duration_s() / kReachCheckS);
  for (std::size_t i = 0; i < count; ++i) {
    const double t_s = static_cast<double>(i) * kReachCheckS;
    const RobotState state = walk.state(t_s);
    for (const Leg leg : kAllLegs) {
      const Vector3d& centre = state.feet.at(static_cast<std::size_t>(leg)).p_world;
      const Vector3d in_base = state.body.T_world_base.inverse() * centre;
      if (!joint_angles_of_centre(walk.geometry(), leg, in_base)) {
        return fail(ErrorCode::kInvalidArgument,
                    "robot: a leg does not reach its swing at {:.2f} s; lower robot.step_height_m, "
                    "robot.speed_mps or robot.body_height_m",
                    t_s);
      }
    }
  }
  return {};
}

}  // namespace

Result<Walk> plan_walk(std::span<const Vector2d> waypoints_world, const WalkOptions& options) {
  if (const auto checked = check_arguments(waypoints_world, options); !checked) {
    return tl::unexpected{checked.error()};
  }
  const Round round{waypoints_world};
  if (!round.is_line()) {
    return fail(ErrorCode::kInvalidArgument,
                "robot: a walk needs two different waypoints, there are {}",
                waypoints_world.size());
  }
  // Standing ends where the smoothed activity begins to rise.
  const double first_move_s =
      options.stand_s + 2 * static_cast<double>(kSmoothSignalReach) * kControlSpacingS;
  const WalkerLimits limits{.speed_mps = options.speed_mps,
                            .speed_variation = options.speed_variation,
                            .yaw_rate_radps = options.yaw_rate_radps,
                            .stand_s = first_move_s,
                            .pause_interval_s = options.pause_interval_s,
                            .pause_s = options.pause_s};
  const auto count =
      static_cast<std::size_t>(std::ceil((options.duration_s + 2) / kControlSpacingS));
  WalkedPath path =
      walk_round(round, limits, RandomStream{options.seed, "robot.path"}, kControlSpacingS, count);
  const std::vector<GaitInterval> gait = gait_intervals(path.moving, options.duration_s);

  BodyPlan plan;
  plan.duration_s = options.duration_s;
  plan.height_m = options.body_height_m;
  plan.x_m = SmoothSignal{kControlSpacingS, std::move(path.x_m)};
  plan.y_m = SmoothSignal{kControlSpacingS, std::move(path.y_m)};
  plan.yaw_rad = SmoothSignal{kControlSpacingS, std::move(path.yaw_rad)};
  plan.phase = gait_phase(options, count);
  plan.activity = activity(gait, count);
  plan.oscillations = gait_oscillations(options);
  plan.wanders = body_wanders(options);

  Walk walk{BodyTrajectory{std::move(plan)}, options};
  for (const Leg leg : kAllLegs) {
    Result<std::vector<Stance>> stances = plan_stances(walk.body(), options, leg, gait);
    if (!stances) {
      return tl::unexpected{std::move(stances).error()};
    }
    walk.stances_.at(static_cast<std::size_t>(leg)) = std::move(*stances);
  }
  if (const auto reached = check_reach(walk); !reached) {
    return tl::unexpected{reached.error()};
  }
  return walk;
}

}  // namespace geoflow::simulator
