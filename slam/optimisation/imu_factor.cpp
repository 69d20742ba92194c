#include "optimisation/imu_factor.hpp"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "optimisation/factors.hpp"

namespace geoflow::slam {
namespace {

/// Least standard deviation of any entry: keeps a sensor that claims no random walk invertible.
constexpr double kLeastSigma = 1e-7;

template <int Size>
using Block = Eigen::Map<Eigen::Matrix<double, kStateSize, Size, Eigen::RowMajor>>;

/// The derivatives by one state's tangent, given to its two blocks.
void write(const StateMatrix& J, const Matrix6d& by_camera, double* pose, double* speed) {
  if (pose != nullptr) {
    Block<kPoseSize> block{pose};
    block.leftCols<kPoseTangentSize>() = J.leftCols<kPoseTangentSize>() * by_camera;
    block.col(kPoseTangentSize).setZero();
  }
  if (speed != nullptr) {
    Block<kSpeedSize>{speed} = J.rightCols<kSpeedSize>();
  }
}

}  // namespace

PoseBlock pose_block(const NavState& state, const SE3& T_cam_imu) noexcept {
  return to_block(state.T_odom_imu * T_cam_imu.inverse());
}

SpeedBlock speed_block(const NavState& state) noexcept {
  SpeedBlock block{};
  Eigen::Map<Eigen::Matrix<double, kSpeedSize, 1>>{block.data()} << state.v_odom,
      state.bias.vector();
  return block;
}

NavState state_of(const double* pose, const double* speed, const SE3& T_cam_imu) noexcept {
  const Eigen::Map<const Eigen::Matrix<double, kSpeedSize, 1>> values{speed};
  const SE3 T_odom_cam = from_block(pose);
  return {.T_odom_imu = T_odom_cam * T_cam_imu,
          .v_odom = values.head<3>(),
          .bias = ImuBias::from(values.tail<kBiasSize>())};
}

ImuFactor::ImuFactor(const Preintegrated& measured, const SE3& T_cam_imu,
                     const Vector3d& gravity_odom, double variance_scale)
    : measured_{measured}, T_cam_imu_{T_cam_imu}, gravity_odom_{gravity_odom} {
  StateMatrix covariance = measured.covariance;
  covariance.diagonal().array() += kLeastSigma * kLeastSigma;
  const double scale = std::sqrt(variance_scale);
  covariance.topRows<kMotionSize>() *= scale;
  covariance.leftCols<kMotionSize>() *= scale;
  root_.setIdentity();
  covariance.llt().matrixL().solveInPlace(root_);
}

bool ImuFactor::Evaluate(const double* const* parameters, double* residuals,
                         double** jacobians) const {
  const NavState first = state_of(parameters[0], parameters[1], T_cam_imu_);
  const NavState second = state_of(parameters[2], parameters[3], T_cam_imu_);
  Eigen::Map<StateVector> values{residuals};
  if (jacobians == nullptr) {
    values = root_ * inertial_residual_value(measured_, first, second, gravity_odom_);
    return true;
  }
  const InertialResidual residual = inertial_residual(measured_, first, second, gravity_odom_);
  values = root_ * residual.value;
  // T_odom_cam exp(xi) T_cam_imu = T_odom_imu exp(T_imu_cam.adjoint() xi).
  const Matrix6d by_camera = T_cam_imu_.inverse().adjoint();
  write(root_ * residual.by_first, by_camera, jacobians[0], jacobians[1]);
  write(root_ * residual.by_second, by_camera, jacobians[2], jacobians[3]);
  return true;
}

}  // namespace geoflow::slam
