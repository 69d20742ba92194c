#pragma once

#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow {

enum class TrackingStatus : std::uint8_t {
  kStarting,      ///< no frame yet
  kInitialising,  ///< frames arrive, no pose yet
  kTracking,
  kDegraded,  ///< a pose, but carried by less than the sensors should give; the covariance says how
              ///< much less
  kRelocalising,  ///< the map does not match; the odometry goes on
  kLost,          ///< nothing tells the way since some time: the pose may be off by a metre or more
};

/// What gave the first guess of a frame's pose (paper, section IV-B, in its order).
enum class PoseSource : std::uint8_t { kNone, kImu, kLegs, kPnp, kGicp, kConstantVelocity };

/// The estimator's answer to one packet.
struct PoseEstimate {
  HostTime t;
  std::uint64_t sequence = 0;
  SE3 T_map_odom;                           ///< may jump when a loop closes
  SE3 T_odom_base;                          ///< never jumps
  Vector3d v_odom_base = Vector3d::Zero();  ///< velocity of base in odom [m/s]
  Vector3d w_base = Vector3d::Zero();       ///< angular velocity of base in base [rad/s]
  Matrix6d covariance =
      Matrix6d::Zero();  ///< of T_odom_base, conventions of geometry.hpp [rad^2, rad m, m^2]
  TrackingStatus status = TrackingStatus::kStarting;
  PoseSource source = PoseSource::kNone;
  std::uint8_t quality = 0;          ///< 0 (nothing) to 100
  std::uint32_t visual_inliers = 0;  ///< map points that agree with the pose
  std::uint32_t depth_inliers = 0;   ///< depth points that agree with the pose
  std::uint32_t reset_counter = 0;   ///< counts discontinuities of T_odom_base
  std::uint32_t map_id = 0;
};

[[nodiscard]] const char* to_string(TrackingStatus status) noexcept;
[[nodiscard]] const char* to_string(PoseSource source) noexcept;

}  // namespace geoflow
