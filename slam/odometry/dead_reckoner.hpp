#pragma once

#include <optional>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/slam/config.hpp"

#include "inertial/gyro_turn.hpp"
#include "inertial/up_direction.hpp"
#include "legs/leg_odometry.hpp"

namespace geoflow::slam {

/// The camera's motion from one packet to the next as the IMU, the legs or the robot's own odometry
/// tell it. cam0 is the camera at the earlier packet, cam1 at the later one.
struct ReckonedMotion {
  SE3 T_cam0_cam1;
  /// Of a right perturbation of T_cam0_cam1.
  Matrix6d covariance = Matrix6d::Zero();
  bool legs = false;  ///< feet or the robot's odometry had part in it
  GyroTurn gyro{};
  std::optional<UpDirection> up{};  ///< in cam1; none without an IMU
};

/// One motion after the other.
[[nodiscard]] ReckonedMotion operator*(const ReckonedMotion& first, const ReckonedMotion& second);

/// Predicts motion without the camera (paper, section IV-B: legged odometry first, then the IMU).
/// It needs the imu's place on the camera; legs and body velocities besides need the camera's on
/// the robot. Thread-compatible.
class DeadReckoner {
 public:
  DeadReckoner(const Switches& switches, const Calibration& calibration);

  /// Takes a packet's samples; the motion since the packet before. None where there is no such
  /// sensor, or it has not found out yet which way is up.
  std::optional<ReckonedMotion> add(const SyncedPacket& packet);

  /// The gyroscope's bias as images tell it [rad/s, imu frame].
  void see_gyro_bias(const Vector3d& bias_radps);

 private:
  [[nodiscard]] std::optional<ReckonedMotion> by_inertia(LegOdometry& odometry,
                                                         const SyncedPacket& packet);
  [[nodiscard]] std::optional<ReckonedMotion> by_twist(const SyncedPacket& packet) const;
  /// A motion of the base with the covariance of its right perturbation, as one of the camera.
  [[nodiscard]] ReckonedMotion of_camera(const SE3& T_base0_base1, const Matrix6d& covariance,
                                         bool legs) const;

  Switches switches_;
  SE3 T_base_cam_;
  double gyro_density_;  ///< LegConfig::gyro_density()
  bool base_known_;
  Matrix3d R_cam_imu_ = Matrix3d::Identity();
  std::optional<LegOdometry> odometry_;
  std::optional<LegEstimate> last_;
  std::optional<HostTime> t_last_;
};

}  // namespace geoflow::slam
