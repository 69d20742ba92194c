#include "geoflow/tools/simulator/leg_simulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/support_forces.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {
namespace {

/// By joint: hip, thigh, calf.
using ByJoint = std::array<double, kJointsPerLeg>;

/// Standard deviation of a real Go2's joint rates at rest [rad/s].
constexpr ByJoint kRateNoiseRadps{0.029, 0.047, 0.013};
/// Smallest steps of a real Go2's rates and torques.
constexpr ByJoint kRateStepRadps{3.8755e-3, 3.8755e-3, 2.0220e-3};
constexpr ByJoint kTorqueStepNm{0.02474, 0.02474, 0.04742};
/// Smallest step of an angle: 1/32768 of a turn of the rotor (GO-M8010-6's position word), through
/// gears of 6.333, and of 12.138 at the calf.
constexpr ByJoint kAngleStepRad{3.028e-5, 3.028e-5, 1.580e-5};

/// Coulomb friction has its full size from here on.
constexpr double kFrictionRateRadps = 0.1;

/// A foot's offset is between this part of the greatest one and all of it: 10 to 45 counts on real
/// feet.
constexpr double kLeastOffset = 0.2;

/// A foot force sensor follows its load through that many equal lags. One alone would be at the
/// peak of touchdown within 0.03 s.
constexpr std::size_t kLags = 2;
/// They rise from 10 to 90 percent of a step in that many of their time constants (Erlang's
/// distribution of order 2).
constexpr double kRiseTimeConstants = 3.3579;

double rounded(double value, double step, bool quantise) {
  return quantise ? std::round(value / step) * step : value;
}

LegTruth truth_of(const RobotState& state) {
  LegTruth truth;
  truth.force_world = support_forces(required_force(state.body), state.feet);
  for (std::size_t i = 0; i < kLegCount; ++i) {
    const FootState& foot = state.feet.at(i);
    truth.contact.at(i) = foot.contact;
    truth.contact_mps.at(i) = foot.contact_mps;
    truth.slipping.at(i) = foot.slipping;
    truth.p_world_foot.at(i) = foot.p_world;
  }
  return truth;
}

}  // namespace

LegSimulator::LegSimulator(const Walk& walk, std::uint64_t seed, const LegSensorOptions& options)
    : walk_{walk}, options_{options}, seed_{seed} {
  RandomStream offsets{seed, "legs.angle_offset"};
  RandomStream scales{seed, "legs.torque_scale"};
  for (std::size_t joint = 0; joint < kLegCount * kJointsPerLeg; ++joint) {
    angle_offset_rad_.at(joint) = options.angle_offset_rad * offsets.normal();
    torque_scale_.at(joint) = 1 + options.torque_scale_error * scales.normal();
  }
  RandomStream zeros{seed, "legs.force_offset"};
  for (double& offset : force_offset_counts_) {
    offset = options.force_offset_counts * zeros.uniform(kLeastOffset, 1);
  }
  // The lags, exactly for loads that are constant between two samples.
  const double time_constant_s = options.force_rise_s / kRiseTimeConstants;
  const double follow =
      time_constant_s > 0 ? 1 - std::exp(-1 / (options.rate_hz * time_constant_s)) : 1;
  const auto count = static_cast<std::size_t>(std::floor(walk.duration_s() * options.rate_hz)) + 1;
  force_counts_.reserve(count);
  std::array<std::array<double, kLags>, kLegCount> lagged{};
  for (std::size_t i = 0; i < count; ++i) {
    const LegTruth now = truth(static_cast<double>(i) / options.rate_hz);
    std::array<double, kLegCount> counts{};
    for (std::size_t foot = 0; foot < kLegCount; ++foot) {
      counts.at(foot) = options.force_counts_per_n * std::max(now.force_world.at(foot).z(), 0.0);
      for (double& lag : lagged.at(foot)) {
        lag += i == 0 ? counts.at(foot) : follow * (counts.at(foot) - lag);
        counts.at(foot) = lag;
      }
    }
    force_counts_.push_back(counts);
  }
}

LegTruth LegSimulator::truth(double t_s) const {
  return truth_of(walk_.state(t_s));
}

Vector3d LegSimulator::torque(Leg leg, const RobotState& state, const Vector3d& force_world) const {
  const auto l = static_cast<std::size_t>(leg);
  const LegMotion& motion = state.legs.at(l);
  // The ground's force acts where the foot touches, the leg's own mass at its end.
  const Matrix3d R_base_world = state.body.T_world_base.rotation_matrix().transpose();
  const Vector3d up_in_base = R_base_world * Vector3d::UnitZ();
  const Matrix3d J_ground =
      foot_contact(walk_.geometry(), leg, motion.q_rad, up_in_base, kGo2Legs.foot_radius_m)
          .jacobian;
  const Matrix3d J_mass = foot_contact(walk_.geometry(), leg, motion.q_rad, up_in_base, 0).jacobian;
  const Vector3d inertial_world = options_.leg_mass_scale * kLegMassKg *
                                  (state.feet.at(l).a_world + kGravityMps2 * Vector3d::UnitZ());
  const Vector3d friction =
      options_.friction_nm * (motion.dq_radps / kFrictionRateRadps).array().tanh().matrix();
  return J_mass.transpose() * (R_base_world * inertial_world) -
         J_ground.transpose() * (R_base_world * force_world) + friction;
}

LegReading LegSimulator::reading(std::size_t index) const {
  LegReading reading;
  reading.t_s = static_cast<double>(index) / options_.rate_hz;
  const RobotState state = walk_.state(reading.t_s);
  reading.truth = truth_of(state);
  RandomStream angle_noise = RandomStream{seed_, "legs.angle_noise"}.at(index);
  RandomStream rate_noise = RandomStream{seed_, "legs.rate_noise"}.at(index);
  RandomStream torque_noise = RandomStream{seed_, "legs.torque_noise"}.at(index);
  RandomStream force_noise = RandomStream{seed_, "legs.force_noise"}.at(index);
  for (const Leg leg : kAllLegs) {
    const auto l = static_cast<std::size_t>(leg);
    const LegMotion& motion = state.legs.at(l);
    const Vector3d torques = torque(leg, state, reading.truth.force_world.at(l));
    for (std::size_t j = 0; j < kJointsPerLeg; ++j) {
      const auto row = static_cast<Eigen::Index>(j);
      const std::size_t joint = l * kJointsPerLeg + j;
      const double q = motion.q_rad[row] + angle_offset_rad_.at(joint) +
                       options_.angle_noise_rad * angle_noise.normal();
      const double dq = motion.dq_radps[row] +
                        options_.rate_noise_scale * kRateNoiseRadps.at(j) * rate_noise.normal();
      const double tau =
          torque_scale_.at(joint) * torques[row] + options_.torque_noise_nm * torque_noise.normal();
      reading.sample.joints.at(joint) = {
          .q_rad = rounded(q, kAngleStepRad.at(j), options_.quantise),
          .dq_radps = rounded(dq, kRateStepRadps.at(j), options_.quantise),
          .tau_nm = rounded(tau, kTorqueStepNm.at(j), options_.quantise)};
    }
    const double counts = force_counts_.at(index).at(l) + force_offset_counts_.at(l) +
                          options_.force_noise_counts * force_noise.normal();
    reading.sample.foot_force.at(l) =
        static_cast<float>(rounded(std::max(counts, 0.0), 1, options_.quantise));
    reading.sample.valid.at(l) = true;
  }
  return reading;
}

}  // namespace geoflow::simulator
