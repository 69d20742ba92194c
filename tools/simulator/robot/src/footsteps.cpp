#include "src/footsteps.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

#include "src/stance_motion.hpp"

namespace geoflow::simulator {
namespace {

/// Where a real Go2 puts its feet while it stands, in base. Source: joint angles recorded on a
/// robot.
constexpr double kFrontFootXM = 0.171;
constexpr double kRearFootXM = -0.209;
constexpr double kFootYM = 0.122;

/// In phase of a stride: how exactly a foot keeps the gait's beat, and its limit, with which two
/// feet stand at any time even at the smallest duty.
constexpr double kBeatDeviation = 0.005;
constexpr double kBeatLimit = 0.012;

/// The stance that a walk begins with starts, and the one that it ends with ends, this far outside
/// it.
constexpr double kOutsideS = 1;

/// A slip takes this time, and starts within this share of the stance.
constexpr double kSlipShortestS = 0.05;
constexpr double kSlipLongestS = 0.12;
constexpr double kSlipEarliest = 0.1;
constexpr double kSlipLatest = 0.5;
/// Of its mean length, a slip is between these.
constexpr double kSlipLeast = 0.5;
constexpr double kSlipMost = 1.5;

/// FL and RR step together, FR and RL half a stride later.
double phase_offset(Leg leg) {
  return leg == Leg::kFrontLeft || leg == Leg::kRearRight ? 0 : 0.5;
}

Vector3d nominal_foot(Leg leg) {
  const bool front = leg == Leg::kFrontRight || leg == Leg::kFrontLeft;
  const bool left = leg == Leg::kFrontLeft || leg == Leg::kRearLeft;
  return {front ? kFrontFootXM : kRearFootXM, left ? kFootYM : -kFootYM, 0};
}

class StancePlanner {
 public:
  StancePlanner(const BodyTrajectory& body, const WalkOptions& options, Leg leg)
      : body_{body},
        options_{options},
        leg_{leg},
        beat_{options.seed, stream_name("beat")},
        place_{options.seed, stream_name("foothold")},
        slip_{options.seed, stream_name("slip")} {}

  Result<std::vector<Stance>> plan(std::span<const GaitInterval> gait) {
    std::vector<Stance> stances = times(gait);
    for (std::size_t i = 0; i < stances.size(); ++i) {
      Stance& stance = stances[i];
      if (i > 0) {
        add_slip(i, stance);
      }
      if (!roll_through(body_, options_, leg_, foothold(i, stance), stance)) {
        return fail(ErrorCode::kInvalidArgument,
                    "robot: a leg does not reach its step at {:.2f} s; lower robot.speed_mps or "
                    "robot.body_height_m, or raise robot.gait_hz",
                    stance.touchdown_s);
      }
    }
    return stances;
  }

 private:
  [[nodiscard]] std::string stream_name(std::string_view what) const {
    return fmt::format("robot.{}.{}", what, static_cast<int>(leg_));
  }

  /// When the leg touches down and lifts off.
  std::vector<Stance> times(std::span<const GaitInterval> gait) {
    std::vector<Stance> stances(1);
    stances.back().touchdown_s = -kOutsideS;
    std::uint64_t step = 0;
    for (const GaitInterval& interval : gait) {
      const double offset = phase_offset(leg_) + options_.duty;
      double liftoff_phase = std::ceil(body_.phase(interval.start_s) - offset) + offset;
      for (;; liftoff_phase += 1) {
        const double liftoff_s = body_.time_of_phase(liftoff_phase + off_beat(++step));
        const double touchdown_s =
            body_.time_of_phase(liftoff_phase + 1 - options_.duty + off_beat(++step));
        if (touchdown_s > interval.end_s) {
          break;
        }
        if (liftoff_s < interval.start_s) {
          continue;
        }
        stances.back().liftoff_s = liftoff_s;
        stances.push_back({.touchdown_s = touchdown_s});
      }
    }
    stances.back().liftoff_s = body_.duration_s() + kOutsideS;
    return stances;
  }

  [[nodiscard]] double off_beat(std::uint64_t step) const {
    return std::clamp(kBeatDeviation * beat_.at(step).normal(), -kBeatLimit, kBeatLimit);
  }

  /// Below the planned body's place at the middle of the stance.
  [[nodiscard]] Vector2d foothold(std::size_t step, const Stance& stance) const {
    const double walking_stance_s = options_.duty / options_.gait_hz;
    const double middle_s = stance.touchdown_s +
                            0.5 * std::min(stance.liftoff_s - stance.touchdown_s, walking_stance_s);
    const SE3 T_world_base = body_.planned(std::max(middle_s, 0.0));
    Vector2d foot = (T_world_base * nominal_foot(leg_)).head<2>();
    if (step > 0) {
      const Vector3d noise = place_.at(step).normal_vector();
      foot += options_.foothold_noise_m * noise.head<2>();
    }
    return foot;
  }

  void add_slip(std::size_t step, Stance& stance) const {
    RandomStream random = slip_.at(step);
    const double stance_s = stance.liftoff_s - stance.touchdown_s;
    if (random.uniform() >= options_.slip_probability) {
      return;
    }
    const double walking_stance_s = std::min(stance_s, options_.duty / options_.gait_hz);
    const double start_s =
        stance.touchdown_s + random.uniform(kSlipEarliest, kSlipLatest) * walking_stance_s;
    const double length_s = std::min(random.uniform(kSlipShortestS, kSlipLongestS),
                                     (1 - kSlipLatest) * walking_stance_s);
    const double way_m = options_.slip_length_m * random.uniform(kSlipLeast, kSlipMost);
    const double direction = random.uniform(0, 2 * std::numbers::pi);
    stance.slips.push_back(
        {.start_s = start_s,
         .end_s = start_s + length_s,
         .way_world = way_m * Vector2d{std::cos(direction), std::sin(direction)}});
  }

  const BodyTrajectory& body_;
  const WalkOptions& options_;
  Leg leg_;
  RandomStream beat_;
  RandomStream place_;
  RandomStream slip_;
};

}  // namespace

Result<std::vector<Stance>> plan_stances(const BodyTrajectory& body, const WalkOptions& options,
                                         Leg leg, std::span<const GaitInterval> gait) {
  return StancePlanner{body, options, leg}.plan(gait);
}

}  // namespace geoflow::simulator
