#include "inertial/inertial_residual.hpp"

#include <Eigen/Core>
#include <Eigen/LU>

#include "geoflow/hal/geometry.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"

namespace geoflow::slam {
namespace {

/// The parts that the residual and its derivatives share.
struct Parts {
  Matrix3d R_imu0_odom;
  Matrix3d R_imu0_imu1;
  Vector3d moved;    ///< in imu0: what dp measures
  Vector3d changed;  ///< in imu0: what dv measures
  StateVector value;

  Parts(const Preintegrated& measured, const NavState& first, const NavState& second,
        const Vector3d& gravity_odom) {
    const double dt = measured.dt_s;
    const SE3& T_odom_imu0 = first.T_odom_imu;
    const SE3& T_odom_imu1 = second.T_odom_imu;
    R_imu0_odom = T_odom_imu0.rotation_matrix().transpose();
    R_imu0_imu1 = R_imu0_odom * T_odom_imu1.rotation_matrix();
    moved = R_imu0_odom * (T_odom_imu1.translation() - T_odom_imu0.translation() -
                           dt * first.v_odom - 0.5 * dt * dt * gravity_odom);
    changed = R_imu0_odom * (second.v_odom - first.v_odom - dt * gravity_odom);
    const Preintegrated::Increments expected = measured.at(first.bias);
    const Eigen::Quaterniond error =
        expected.R_imu0_imu1.conjugate() * Eigen::Quaterniond{R_imu0_imu1};
    value << so3::log(error), moved - expected.dp, changed - expected.dv,
        second.bias.vector() - first.bias.vector();
  }
};

}  // namespace

StateVector inertial_residual_value(const Preintegrated& measured, const NavState& first,
                                    const NavState& second, const Vector3d& gravity_odom) {
  return Parts{measured, first, second, gravity_odom}.value;
}

InertialResidual inertial_residual(const Preintegrated& measured, const NavState& first,
                                   const NavState& second, const Vector3d& gravity_odom) {
  const double dt = measured.dt_s;
  const Parts parts{measured, first, second, gravity_odom};
  const Vector3d error = parts.value.segment<3>(kRotationAt);
  const Matrix3d J_error = so3::right_jacobian_inverse(error);
  const Vector3d correction =
      measured.by_bias.topRows<3>() * (first.bias.vector() - measured.bias.vector());

  InertialResidual result;
  result.value = parts.value;
  StateMatrix& by_first = result.by_first;
  by_first.block<3, 3>(kRotationAt, kRotationAt) = -J_error * parts.R_imu0_imu1.transpose();
  by_first.block<3, 3>(kTranslationAt, kRotationAt) = skew(parts.moved);
  by_first.block<3, 3>(kVelocityAt, kRotationAt) = skew(parts.changed);
  by_first.block<3, 3>(kTranslationAt, kTranslationAt) = -Matrix3d::Identity();
  by_first.block<3, 3>(kTranslationAt, kVelocityAt) = -dt * parts.R_imu0_odom;
  by_first.block<3, 3>(kVelocityAt, kVelocityAt) = -parts.R_imu0_odom;
  by_first.topRightCorner<kMotionSize, kBiasSize>() = -measured.by_bias;
  by_first.block<3, kBiasSize>(kRotationAt, kGyroBiasAt) =
      -J_error * so3::exp(error).toRotationMatrix().transpose() * so3::right_jacobian(correction) *
      measured.by_bias.topRows<3>();
  by_first.bottomRightCorner<kBiasSize, kBiasSize>() = -BiasMatrix::Identity();

  StateMatrix& by_second = result.by_second;
  by_second.setIdentity();
  by_second.block<3, 3>(kRotationAt, kRotationAt) = J_error;
  by_second.block<3, 3>(kTranslationAt, kTranslationAt) = parts.R_imu0_imu1;
  by_second.block<3, 3>(kVelocityAt, kVelocityAt) = parts.R_imu0_odom;

  result.by_gravity.middleRows<3>(kTranslationAt) = -0.5 * dt * dt * parts.R_imu0_odom;
  result.by_gravity.middleRows<3>(kVelocityAt) = -dt * parts.R_imu0_odom;
  return result;
}

UncertainState predict(const UncertainState& first, const Preintegrated& measured,
                       const Vector3d& gravity_odom) {
  const double dt = measured.dt_s;
  const NavState& from = first.state;
  const SE3& T_odom_imu0 = from.T_odom_imu;
  const Preintegrated::Increments moved = measured.at(from.bias);
  const Eigen::Quaterniond& R_odom_imu0 = T_odom_imu0.rotation();

  UncertainState second;
  second.state.T_odom_imu = SE3{R_odom_imu0 * moved.R_imu0_imu1,
                                T_odom_imu0.translation() + dt * from.v_odom +
                                    0.5 * dt * dt * gravity_odom + R_odom_imu0 * moved.dp};
  second.state.v_odom = from.v_odom + dt * gravity_odom + R_odom_imu0 * moved.dv;
  second.state.bias = from.bias;

  // Where the residual is zero, by_second * d_second = d_measured - by_first * d_first.
  const InertialResidual at = inertial_residual(measured, first.state, second.state, gravity_odom);
  const StateMatrix inverse = at.by_second.inverse();
  const StateMatrix through = inverse * at.by_first;
  second.covariance = through * first.covariance * through.transpose() +
                      inverse * measured.covariance * inverse.transpose();
  return second;
}

}  // namespace geoflow::slam
