#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {

/// The legs' sensors. Ranges and explanations are in leg_knobs(); all noise off: exact_legs().
/// Sources of the defaults: a real Go2's joint states at rest; the position word of Unitree's
/// GO-M8010-6 motor; foot force recordings of a real Go1.
struct LegSensorOptions {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member, its unit by the
  // knob
  double rate_hz = 500;
  double angle_noise_rad = 1e-4;
  double angle_offset_rad = 3e-3;
  double rate_noise_scale = 1;
  bool quantise = true;
  double torque_noise_nm = 0.15;
  double torque_scale_error = 0.02;
  double friction_nm = 0.2;
  double leg_mass_scale = 1;
  double force_offset_counts = 45;
  double force_counts_per_n = 5.5;
  double force_rise_s = 0.105;
  double force_noise_counts = 1;
  // NOLINTEND(readability-magic-numbers)
};

/// The rows "legs.…" of the table of knobs.
[[nodiscard]] std::span<const Knob<LegSensorOptions>> leg_knobs();

/// No noise, offset, lag or quantum, massless legs without friction, forces in newtons.
[[nodiscard]] LegSensorOptions exact_legs();

/// What is true while a sample says what it says; legs in the order of `Leg`.
struct LegTruth {
  std::array<bool, kLegCount> contact{};
  std::array<Vector3d, kLegCount>
      contact_mps{};  ///< of the touching point, in world; slip and soft ground
  std::array<bool, kLegCount> slipping{};
  std::array<Vector3d, kLegCount> p_world_foot{};  ///< centre of the foot's sphere [m]
  std::array<Vector3d, kLegCount> force_world{};   ///< of the ground on the foot [N]
};

struct LegReading {
  double t_s = 0;
  LegSample sample;
  LegTruth truth;
};

/// The legs' encoders, torque estimates and foot force sensors on a walk. Const calls are
/// thread-safe.
class LegSimulator {
 public:
  /// Keeps a reference to `walk`, which must live longer.
  LegSimulator(const Walk& walk, std::uint64_t seed, const LegSensorOptions& options);

  /// How many samples the walk has: at index / rate_hz from 0 to its duration.
  [[nodiscard]] std::size_t size() const noexcept { return force_counts_.size(); }
  /// `index` < size(). Its noise depends on seed and index alone.
  [[nodiscard]] LegReading reading(std::size_t index) const;

  /// Truth at any time of the walk.
  [[nodiscard]] LegTruth truth(double t_s) const;

 private:
  [[nodiscard]] Vector3d torque(Leg leg, const RobotState& state,
                                const Vector3d& force_world) const;

  const Walk& walk_;
  LegSensorOptions options_;
  std::uint64_t seed_;
  std::array<double, kLegCount * kJointsPerLeg> angle_offset_rad_{};
  std::array<double, kLegCount * kJointsPerLeg> torque_scale_{};
  std::array<double, kLegCount> force_offset_counts_{};
  std::vector<std::array<double, kLegCount>> force_counts_;  ///< lagged, by sample, without noise
};

}  // namespace geoflow::simulator
