#include "legs/foot_motion.hpp"

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/leg_kinematics.hpp"
#include "geoflow/hal/samples.hpp"

#include "legs/leg_config.hpp"

namespace geoflow::slam {

FootMotion foot_motion(const LegConfig& config, Leg leg, const LegJoints& joints,
                       const BaseTurn& turn) {
  const LegNoise& noise = config.noise;
  const FootContact centre = foot_contact(config.geometry, leg, joints.q_rad, turn.up_base, 0);
  FootMotion motion;
  motion.contact = foot_contact(config.geometry, leg, joints.q_rad, turn.up_base,
                                config.rolling * config.geometry.foot_radius_m);
  motion.centre = centre.point;
  motion.centre_covariance =
      noise.q_rad * noise.q_rad * centre.jacobian * centre.jacobian.transpose() +
      noise.point_m * noise.point_m * Matrix3d::Identity();
  motion.R_base_calf = calf_rotation(joints.q_rad);
  motion.v_base = base_velocity_from_stance(motion.contact, joints.dq_radps, turn.w_base_radps);
  const Matrix3d by_rate = motion.contact.jacobian * noise.dq_radps.asDiagonal();
  const Matrix3d by_turn = turn.sigma_radps * skew(motion.contact.point);
  motion.v_covariance = by_rate * by_rate.transpose() + by_turn * by_turn.transpose();
  return motion;
}

}  // namespace geoflow::slam
