#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

/// A Unitree Go2 as it speaks over DDS on its Ethernet (docs/legs.md).
namespace geoflow::drivers {

struct DdsRobotOptions {
  std::string
      interface{};  ///< name of a network interface; empty: what CYCLONEDDS_URI says, or any
  int domain = 0;   ///< the robot's; Unitree's simulator has 1
  std::string topic = "rt/lowstate";
};

/// The legs and the body's IMU of one robot, stamped by the robot's clock. The ports live as long
/// as this. Nothing is ever sent to the robot.
class DdsRobot {
 public:
  /// Whether the interface is there and what comes over it, the ports' health() says. An error
  /// (kUnsupported) is a program that was built without DDS.
  [[nodiscard]] static Result<std::unique_ptr<DdsRobot>> open(const DdsRobotOptions& options);

  DdsRobot() = default;
  DdsRobot(const DdsRobot&) = delete;
  DdsRobot& operator=(const DdsRobot&) = delete;
  virtual ~DdsRobot() = default;

  [[nodiscard]] virtual Legs& legs() = 0;
  /// In the frame of the robot's IMU: x forward, z up; T_base_imu is body_imu_in_base().
  [[nodiscard]] virtual Imu& body_imu() = 0;
};

/// Where the Go2's body IMU is [m]; it is not turned against base. Source: unitree_ros,
/// robots/go2_description/urdf/go2_description.urdf.
[[nodiscard]] inline SE3 body_imu_in_base() {
  // NOLINTNEXTLINE(readability-magic-numbers): the URDF's
  return SE3{Matrix3d::Identity(), Vector3d{-0.02557, 0, 0.04232}};
}

}  // namespace geoflow::drivers
