#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"

/// Gravity, velocities and biases of an IMU that moves, from poses that camera and depth gave
/// without it.
namespace geoflow::slam {

/// A pose of the imu by camera and depth, of metric scale, and how well it is known.
struct SeenPose {
  SE3 T_odom_imu;
  double rotation_sigma_rad = 0;
  double translation_sigma_m = 0;
};

struct MotionFix {
  Vector3d gravity_odom = Vector3d::Zero();  ///< of length kStandardGravity [m/s^2]
  double gravity_sigma_rad = 0;              ///< of its direction, in the worst direction
  std::vector<NavState> states;              ///< at the poses, oldest first, with one common bias
  StateMatrix covariance = StateMatrix::Zero();  ///< of the newest state
  double chi_square_per_dof = 0;                 ///< how well all agrees, 1 where it does
};

/// The most probable states at `poses` and gravity, given the poses, what was preintegrated between
/// neighbours (one fewer than poses) and the prior of the biases. Odom may be any frame: it need
/// not be level. Pure function, thread-safe.
///
/// As in Campos, Montiel, Tardos, "Inertial-Only Optimization for Visual-Inertial
/// Initialization", ICRA 2020, without scale, which depth gives, and with poses that have noise of
/// their own: Gauss-Newton on all states, one bias and the direction of gravity, started from
/// finite differences (Qin, Li, Shen, "VINS-Mono", T-RO 2018, V-B). The covariance is the inverse
/// of the normal matrix.
///
/// Errors: kInvalidArgument where the numbers of poses and increments do not fit or are below three
/// poses; kUnavailable where it is not observable (gravity worse than 0.03 rad, velocity than
/// 0.1 m/s, gyro bias than 0.01 rad/s, each one standard deviation) or where IMU and poses disagree
/// (chi-square above 3 per degree of freedom: wrong extrinsics, scale or times).
///
/// Where the gyro bias moves by more than 0.02 rad/s from the one integrated at, integrate again
/// and repeat.
[[nodiscard]] Result<MotionFix> align_motion(std::span<const SeenPose> poses,
                                             std::span<const Preintegrated> between,
                                             const BiasPrior& prior);

}  // namespace geoflow::slam
