#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/time.hpp"

/// What sensors say. Plain values, raw: not calibrated, not filtered.
namespace geoflow {

/// One inertial measurement in the imu frame.
struct ImuSample {
  Vector3d accel_mps2 = Vector3d::Zero();  ///< specific force (+9.81 upwards at rest) [m/s^2]
  Vector3d gyro_radps = Vector3d::Zero();  ///< angular velocity [rad/s]
};

/// Legs in Unitree's SDK order.
enum class Leg : std::uint8_t { kFrontRight, kFrontLeft, kRearRight, kRearLeft };
inline constexpr std::size_t kLegCount = 4;
inline constexpr std::size_t kJointsPerLeg = 3;  ///< hip (abduction), thigh, calf

/// One joint's encoder; angles as in Unitree's SDK (zero and sign of the URDF).
struct JointState {
  double q_rad = 0;
  double dq_radps = 0;
  double tau_nm = 0;
};

/// All legs at one instant. Joint of leg l: index l * 3 + {0 hip, 1 thigh, 2 calf}, legs in the
/// order of `Leg`.
struct LegSample {
  std::array<JointState, kLegCount * kJointsPerLeg> joints{};
  std::array<float, kLegCount>
      foot_force{};  ///< sensor counts or N as the robot reports it; 0 where there is none
  std::array<bool, kLegCount>
      valid{};  ///< false where this leg's encoders were not heard this time
};

/// A robot's own odometry: the twist of base_link expressed in base_link.
struct BodyVelocitySample {
  Vector3d v_base_mps = Vector3d::Zero();
  Vector3d w_base_radps = Vector3d::Zero();
};

/// A colour (or gray) image.
struct ColorFrame {
  FrameRef image;
};

/// A depth image registered to the colour camera (kDepth16).
struct DepthFrame {
  FrameRef image;
};

/// A sample as a port delivers it: stamped by its device's clock and by the host on arrival
/// (CLOCK_MONOTONIC).
template <typename Clock, typename Sample>
struct Arrival {
  DeviceTime<Clock> t_device;
  HostTime t_arrival;
  Sample sample;
};

/// A sample placed on the host's time line by timesync.
template <typename Sample>
struct Timed {
  HostTime t;
  Duration
      error_bound{};  ///< the true instant is within t +- this, as far as the clock model can tell
  Sample sample;
};

}  // namespace geoflow
