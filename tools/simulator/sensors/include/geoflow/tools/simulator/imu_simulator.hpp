#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {

/// The camera's IMU. Ranges and explanations are in imu_knobs(); all errors off: exact_imu().
/// Sources of the defaults: the D435i's BMI055 (datasheet: range, resolution, noise of
/// 150 ug/sqrt(Hz) and 0.014 degrees/s/sqrt(Hz), zero offset, sensitivity to acceleration), and the
/// shocks in a real Go1's body IMU.
struct ImuOptions {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member, its unit by the
  // knob
  double rate_hz = 200;
  /// Densities at noise_scale 1; its rate is not used.
  ImuNoise noise{.accel_noise_density = 1.471e-3, .gyro_noise_density = 2.443e-4};
  double noise_scale = 1;
  double accel_bias_mps2 = 0.1;
  double gyro_bias_radps = 5e-3;
  double scale_error = 2e-3;
  double misalignment_rad = 2e-3;
  double gyro_per_accel = 1.8e-4;
  bool quantise = true;
  double accel_range_mps2 = 39.2266;
  double gyro_range_radps = 17.453;

  double shock_mps2 = 8;
  double shock_gyro_radps = 0.4;
  double shock_ring_hz = 50;
  double shock_damping = 0.12;

  double fault_interval_s = 0;
  double fault_s = 1.5;
  double fault_mps2 = 40;
  // NOLINTEND(readability-magic-numbers)
};

/// The rows "imu.…" of the table of knobs.
[[nodiscard]] std::span<const Knob<ImuOptions>> imu_knobs();

/// No noise, bias, quantum, limit, shock or fault.
[[nodiscard]] ImuOptions exact_imu();

/// Shocks of up to 40 m/s^2 in all directions at touchdown, as in the recordings of GeoFlow-SLAM's
/// robot. Other options stay as given.
[[nodiscard]] ImuOptions with_hard_shocks(ImuOptions options);

struct ImuReading {
  double t_s = 0;
  ImuSample sample;
  Vector3d accel_bias_mps2 = Vector3d::Zero();  ///< true bias at this time
  Vector3d gyro_bias_radps = Vector3d::Zero();
  bool faulty = false;  ///< within a burst of distortion
};

/// Specific force and angular velocity of an ideal IMU at `T_base_imu` on a body that moves like
/// this.
[[nodiscard]] ImuSample ideal_imu(const BodyState& body, const SE3& T_base_imu);

/// Everything that an IMU says on a walk, in order of time: at index / rate_hz from 0 to its
/// duration. Deterministic by seed.
class ImuSimulator {
 public:
  /// Keeps a reference to `walk`, which must live longer.
  ImuSimulator(const Walk& walk, const SE3& T_base_imu, std::uint64_t seed,
               const ImuOptions& options);

  [[nodiscard]] std::vector<ImuReading> readings() const;

 private:
  const Walk& walk_;
  SE3 T_base_imu_;
  std::uint64_t seed_;
  ImuOptions options_;
};

}  // namespace geoflow::simulator
