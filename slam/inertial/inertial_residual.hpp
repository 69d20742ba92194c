#pragma once

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"

/// How two states agree with what was preintegrated between them, and what it predicts of the
/// second. Pure functions, thread-safe. `gravity_odom` is gravity in odom [m/s^2], gravity_down()
/// where odom's z points up.
namespace geoflow::slam {

/// Forster 2017, equation (45) with the bias walks of (48): 15 entries in NavState's order,
/// (rotation, position, velocity) in imu0, the imu frame at the first state.
struct InertialResidual {
  StateVector value = StateVector::Zero();
  /// Derivatives by the tangents of the first and of the second state.
  StateMatrix by_first = StateMatrix::Zero();
  StateMatrix by_second = StateMatrix::Zero();
  /// Derivative by gravity_odom.
  Eigen::Matrix<double, kStateSize, 3> by_gravity = Eigen::Matrix<double, kStateSize, 3>::Zero();
};

/// The residual, whose covariance is `measured.covariance`, and its derivatives.
[[nodiscard]] InertialResidual inertial_residual(const Preintegrated& measured,
                                                 const NavState& first, const NavState& second,
                                                 const Vector3d& gravity_odom);

/// The residual alone.
[[nodiscard]] StateVector inertial_residual_value(const Preintegrated& measured,
                                                  const NavState& first, const NavState& second,
                                                  const Vector3d& gravity_odom);

/// A state with the covariance of its tangent.
struct UncertainState {
  NavState state;
  StateMatrix covariance = StateMatrix::Zero();
};

/// The second state that makes the residual zero, with the first one's covariance carried on and
/// the measurement's added.
[[nodiscard]] UncertainState predict(const UncertainState& first, const Preintegrated& measured,
                                     const Vector3d& gravity_odom);

}  // namespace geoflow::slam
