#pragma once

#include <array>

#include <ceres/sized_cost_function.h>

#include "geoflow/hal/geometry.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "optimisation/factors.hpp"

/// The inertial factor of bundle adjustment, with analytic Jacobians.
namespace geoflow::slam {

/// A speed parameter: velocity of the imu in odom [m/s], gyro bias [rad/s], accel bias [m/s^2].
inline constexpr int kSpeedSize = 9;
using SpeedBlock = std::array<double, kSpeedSize>;

/// The blocks of a state, for a camera that carries the IMU at T_cam_imu.
[[nodiscard]] PoseBlock pose_block(const NavState& state, const SE3& T_cam_imu) noexcept;
[[nodiscard]] SpeedBlock speed_block(const NavState& state) noexcept;
/// And back.
[[nodiscard]] NavState state_of(const double* pose, const double* speed,
                                const SE3& T_cam_imu) noexcept;

/// IMU preintegration between two keyframes (paper, equation (4)): L^-1 r, with r
/// inertial_residual() and L L^T its covariance; parameters: pose i (T_odom_cam), speed i, pose j,
/// speed j.
class ImuFactor final
    : public ceres::SizedCostFunction<kStateSize, kPoseSize, kSpeedSize, kPoseSize, kSpeedSize> {
 public:
  /// `variance_scale` (>= 1) widens the motion's covariance, as ImuHealth says; the biases' walk
  /// stays as it is.
  ImuFactor(const Preintegrated& measured, const SE3& T_cam_imu, const Vector3d& gravity_odom,
            double variance_scale = 1);
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Preintegrated measured_;
  SE3 T_cam_imu_;
  Vector3d gravity_odom_;
  StateMatrix root_;  ///< L^-1
};

}  // namespace geoflow::slam
