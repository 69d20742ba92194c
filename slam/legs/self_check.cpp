#include "legs/self_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

#include "inertial/nav_state.hpp"

namespace geoflow::slam {
namespace {

constexpr double kWeightTolerance = 0.15;
constexpr double kLevelForce = 10;  // [N]
/// Of the weight's line from the middle of the feet, as a share of half their distance.
constexpr double kCentre = 0.5;

/// Which leg's joints a place has.
using Order = std::array<std::size_t, kLegCount>;
constexpr Order kAsGiven{0, 1, 2, 3};
constexpr Order kSidesSwapped{1, 0, 3, 2};

struct Load {
  StandingLoad sum;
  double middle_x_m = 0;     ///< of the feet
  double half_length_m = 0;  ///< from there to the front feet
};

std::optional<Load> load_of(const LegGeometry& geometry, const LegSample& sample,
                            const Vector3d& up_base, const Order& order) {
  Load load;
  double moment = 0;
  double front_x = 0;
  double rear_x = 0;
  for (std::size_t place = 0; place < kLegCount; ++place) {
    const auto leg = static_cast<Leg>(place);
    const LegJoints joints = joints_of(sample, static_cast<Leg>(order.at(place)));
    const FootContact contact =
        foot_contact(geometry, leg, joints.q_rad, up_base, geometry.foot_radius_m);
    const std::optional<Vector3d> force = ground_force(contact.jacobian, joints.tau_nm);
    if (!force) {
      return std::nullopt;
    }
    const bool left = leg == Leg::kFrontLeft || leg == Leg::kRearLeft;
    const bool front = leg == Leg::kFrontLeft || leg == Leg::kFrontRight;
    load.sum.force_base += *force;
    // The ground pushes inwards on feet that push outwards.
    load.sum.outward_n += (left ? -force->y() : force->y()) / kLegCount;
    moment += contact.point.x() * up_base.dot(*force);
    (front ? front_x : rear_x) += 0.5 * contact.point.x();
  }
  load.sum.weight_n = up_base.dot(load.sum.force_base);
  load.sum.centre_x_m = moment / load.sum.weight_n;
  load.middle_x_m = 0.5 * (front_x + rear_x);
  load.half_length_m = 0.5 * (front_x - rear_x);
  return load;
}

double off_centre(const Load& load) {
  return std::abs(load.sum.centre_x_m - load.middle_x_m) / load.half_length_m;
}

}  // namespace

Result<StandingLoad> check_standing_load(const LegGeometry& geometry, const LegSample& sample,
                                         const Vector3d& up_base, double mass_kg) {
  if (!std::ranges::all_of(sample.valid, [](bool valid) { return valid; })) {
    return fail(ErrorCode::kUnavailable, "legs: not all four were heard");
  }
  if (std::ranges::all_of(sample.joints, [](const JointState& j) { return j.tau_nm == 0; })) {
    return fail(ErrorCode::kUnavailable, "legs: the joints report no torques");
  }
  const std::optional<Load> load = load_of(geometry, sample, up_base, kAsGiven);
  if (!load) {
    return fail(ErrorCode::kUnavailable, "legs: a leg is stretched or folded; no force is known");
  }
  const StandingLoad& sum = load->sum;
  const double expected = mass_kg * kStandardGravity;
  if (sum.weight_n < 0) {
    return fail(ErrorCode::kInvalidData,
                "legs: the torques pull the robot down with {:.0f} N instead of carrying {:.0f} N: "
                "their sign is reversed",
                -sum.weight_n, expected);
  }
  if (sum.outward_n < -kLevelForce || sum.outward_n > kLevelForce) {
    const std::optional<Load> other = load_of(geometry, sample, up_base, kSidesSwapped);
    const bool explains = other && std::abs(other->sum.outward_n) < kLevelForce;
    return fail(ErrorCode::kInvalidData, "legs: each foot pushes {:.0f} N {}: {}",
                std::abs(sum.outward_n), sum.outward_n > 0 ? "outwards" : "inwards",
                explains ? "left and right legs are swapped (order is FR, FL, RR, RL)"
                         : "a hip's sign or torque is wrong");
  }
  if (std::abs(sum.weight_n / expected - 1) > kWeightTolerance) {
    return fail(
        ErrorCode::kInvalidData,
        "legs: the torques carry {:.1f} N, the robot weighs {:.1f} N: their scale is off by "
        "a factor of {:.2f}",
        sum.weight_n, expected, sum.weight_n / expected);
  }
  const Vector3d level = sum.force_base - sum.weight_n * up_base;
  if (level.norm() > kLevelForce) {
    return fail(ErrorCode::kInvalidData,
                "legs: the ground pushes a standing robot by ({:.0f}, {:.0f}) N along: joint signs "
                "or the order of joints are wrong",
                level.x(), level.y());
  }
  if (off_centre(*load) > kCentre) {
    return fail(ErrorCode::kInvalidData,
                "legs: the weight lies {:.2f} m in front of the feet's middle: a leg's torques or "
                "angles are wrong",
                sum.centre_x_m - load->middle_x_m);
  }
  return sum;
}

}  // namespace geoflow::slam
