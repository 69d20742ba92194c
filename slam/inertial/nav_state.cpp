#include "inertial/nav_state.hpp"

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

Vector6d ImuBias::vector() const {
  Vector6d v;
  v << gyro_radps, accel_mps2;
  return v;
}

NavState NavState::plus(const StateVector& delta) const {
  return {.T_odom_imu = T_odom_imu * SE3::exp(delta.head<kVelocityAt>()),
          .v_odom = v_odom + delta.segment<3>(kVelocityAt),
          .bias = ImuBias::from(bias.vector() + delta.tail<kBiasSize>())};
}

StateVector NavState::minus(const NavState& other) const {
  StateVector delta;
  delta << (other.T_odom_imu.inverse() * T_odom_imu).log(), v_odom - other.v_odom,
      bias.vector() - other.bias.vector();
  return delta;
}

}  // namespace geoflow::slam
