#pragma once

#include <algorithm>
#include <cmath>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"

namespace geoflow::slam {

// NOLINTBEGIN(readability-magic-numbers): each default is named, and given its unit, by its member

/// What a leg's encoders and its foot on the ground do besides what the kinematics say.
struct LegNoise {
  /// Of a joint's angle: twice the step in which a Go2's motors report it, for backlash [rad].
  double q_rad = 1e-3;
  /// Of the joints' rates: a real Go2 standing still, hip, thigh, calf [rad/s].
  Vector3d dq_radps{0.03, 0.05, 0.02};
  /// Of the point of contact: flexing links, a foot that is no sphere [m].
  double point_m = 1e-3;
  /// Creep of a foot that stands: random walk of its place along the ground, and across it, where
  /// the ground holds it [m/sqrt(s)].
  double creep = 1e-2;
  double sinking = 2e-3;
  /// The same right after touchdown, while foot and joints give way and the sole slides into place,
  /// fading with `settling_s`: a real Go1's foot moves by 1 to 2 cm [m/sqrt(s)].
  double settling = 0.15;
  double settling_s = 0.04;  ///< [s]
  /// Error of a standing foot's velocity that lasts for `speed_memory_s`: the ground gives way, the
  /// foot rolls otherwise than thought [m/s].
  double speed_mps = 0.02;
  double speed_memory_s = 0.1;  ///< [s]
  /// Error of lengths, radius and timing that does not average out, as a share of the way [1].
  double scale = 0.01;

  /// Random walk of a foot's place after it has stood for `stance_s`, while it is this sure that
  /// the ground bears on it (FootState::grip), x, y and z [m/sqrt(s)].
  [[nodiscard]] Vector3d creep_of(double stance_s, double grip) const noexcept {
    const double slides = settling * loose(stance_s, grip);
    return {creep + slides, creep + slides, sinking + slides};
  }
  /// Standard deviation of its speed then, independent from sample to sample [m/s].
  [[nodiscard]] double speed_of(double stance_s, double grip) const noexcept {
    return speed_mps + settling / std::sqrt(settling_s) * loose(stance_s, grip);
  }

  /// How much of its settling a foot does: all at touchdown, and without a load.
  [[nodiscard]] double loose(double stance_s, double grip) const noexcept {
    return std::max(std::exp(-stance_s / settling_s), 1 - grip);
  }
};

/// How a robot's legs are to be understood.
struct LegConfig {
  LegGeometry geometry = kGo2Legs;
  /// Share of the foot's geometric radius on which it rolls: 1 for a hard sphere, 0 for a foot that
  /// is pinned to the ground. Calibrated.
  double rolling = 1;
  SE3 T_base_imu;
  LegNoise noise;
  ImuNoise imu_noise;
  /// Error of a robot's own odometry twist, which lasts for LegNoise::speed_memory_s [m/s].
  double twist_mps = 0.05;
  /// What a walking body's shocks and the mounting's vibration add to the accelerometer's noise
  /// density [m/s^2/sqrt(Hz)]. Source: Cerberus trusts it with 0.9 m/s^2 at 400 Hz.
  double shock_density = 0.045;
  /// The same for the gyroscope's: shaken at touchdown, scale and sensitivity to acceleration. Of
  /// simulated walks, with what a D435i's datasheet says of these [rad/s/sqrt(Hz)].
  double shock_turn_density = 1e-3;

  /// Noise densities of the IMU on a body that walks, units as in ImuNoise.
  [[nodiscard]] double accel_density() const noexcept {
    return std::hypot(imu_noise.accel_noise_density, shock_density);
  }
  [[nodiscard]] double gyro_density() const noexcept {
    return std::hypot(imu_noise.gyro_noise_density, shock_turn_density);
  }
};

// NOLINTEND(readability-magic-numbers)

/// Of a robot whose IMU's place is known (Calibration::T_cam_imu). Without the camera's place on
/// the robot, base is the camera, and legs are not to be heard.
[[nodiscard]] inline LegConfig leg_config_of(const Calibration& calibration) {
  LegConfig config;
  const SE3 T_base_cam = calibration.T_base_cam.value_or(SE3{});
  config.T_base_imu = T_base_cam * calibration.T_cam_imu.value_or(SE3{});
  config.imu_noise = calibration.imu_noise;
  return config;
}

}  // namespace geoflow::slam
