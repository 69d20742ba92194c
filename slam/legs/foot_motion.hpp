#pragma once

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"

#include "legs/leg_config.hpp"

namespace geoflow::slam {

/// What one leg's joints say of its foot, in base.
struct FootMotion {
  FootContact contact;         ///< the point of the rolling sphere that touches level ground
  Vector3d centre;             ///< of the foot's sphere [m]
  Matrix3d centre_covariance;  ///< by the angles' noise [m^2]
  Matrix3d R_base_calf;
  /// Base's velocity in base if the contact stands [m/s], and its covariance by the noise of the
  /// joints' rates and of the gyroscope.
  Vector3d v_base;
  Matrix3d v_covariance;
};

/// Turn of base at an instant, in base.
struct BaseTurn {
  Vector3d w_base_radps = Vector3d::Zero();
  double sigma_radps = 0;                ///< of each axis
  Vector3d up_base = Vector3d::UnitZ();  ///< the ground's normal
};

/// Pure.
[[nodiscard]] FootMotion foot_motion(const LegConfig& config, Leg leg, const LegJoints& joints,
                                     const BaseTurn& turn);

}  // namespace geoflow::slam
