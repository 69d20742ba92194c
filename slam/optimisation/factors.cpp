#include "optimisation/factors.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "geoflow/hal/geometry.hpp"

#include "optimisation/matrix6.hpp"

namespace geoflow::slam {
namespace {

template <int Rows>
using PoseJacobian = Eigen::Map<Eigen::Matrix<double, Rows, kPoseSize, Eigen::RowMajor>>;

/// The camera-frame point and its derivatives by pose and point.
struct CameraPoint {
  Vector3d p_cam;
  Matrix3d R_cam_odom;

  CameraPoint(const double* pose, const double* point) {
    const SE3 T_odom_cam = from_block(pose);
    R_cam_odom = T_odom_cam.rotation_matrix().transpose();
    p_cam = R_cam_odom * (Eigen::Map<const Vector3d>{point} - T_odom_cam.translation());
  }
  /// J is d(residual)/d(p_cam).
  template <int Rows>
  void chain(const Eigen::Matrix<double, Rows, 3>& J, double** jacobians) const {
    if (jacobians == nullptr) {
      return;
    }
    if (jacobians[0] != nullptr) {
      PoseJacobian<Rows> by_pose{jacobians[0]};
      by_pose.template leftCols<3>() = J * skew(p_cam);
      by_pose.template middleCols<3>(3) = -J;
      by_pose.col(kPoseTangentSize).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Rows, 3, Eigen::RowMajor>>{jacobians[1]} = J * R_cam_odom;
    }
  }
};

/// A symmetric root stays real and finite where a direction is open (eigenvalue zero, or a rounding
/// below it).
Matrix6d root(const Matrix6d& information) {
  const SymmetricEigen eigen = symmetric_eigen(information);
  return eigen.directions * eigen.eigenvalues.cwiseMax(0).cwiseSqrt().asDiagonal() *
         eigen.directions.transpose();
}

/// log(Z^-1 Ta^-1 Tb) of the first two parameters, which are poses; residuals and the jacobians by
/// these, which may be null, with the weight W.
Vector6d relative_error(const SE3& T_b_a, const Matrix6d& W, const double* const* parameters,
                        double* residuals, double** jacobians) {
  const SE3 T_odom_a = from_block(parameters[0]);
  const SE3 T_odom_b = from_block(parameters[1]);
  const SE3 T_a_b = T_odom_a.inverse() * T_odom_b;
  const Vector6d error = (T_b_a * T_a_b).log();
  Eigen::Map<Vector6d>{residuals} = W * error;
  if (jacobians == nullptr) {
    return error;
  }
  const Matrix6d J = W * SE3::right_jacobian_inverse(error);
  if (jacobians[0] != nullptr) {
    PoseJacobian<kPoseTangentSize> by_a{jacobians[0]};
    by_a.leftCols<kPoseTangentSize>() = -J * T_a_b.inverse().adjoint();
    by_a.col(kPoseTangentSize).setZero();
  }
  if (jacobians[1] != nullptr) {
    PoseJacobian<kPoseTangentSize> by_b{jacobians[1]};
    by_b.leftCols<kPoseTangentSize>() = J;
    by_b.col(kPoseTangentSize).setZero();
  }
  return error;
}

}  // namespace

PoseBlock to_block(const SE3& T) noexcept {
  const Eigen::Quaterniond& q = T.rotation();
  const Vector3d& p = T.translation();
  return {q.x(), q.y(), q.z(), q.w(), p.x(), p.y(), p.z()};
}

SE3 from_block(const double* block) noexcept {
  return SE3{Eigen::Quaterniond{Eigen::Map<const Eigen::Vector4d>{block}},
             Eigen::Map<const Vector3d>{block + 4}};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const PoseBlock block = to_block(from_block(x) * SE3::exp(Eigen::Map<const Vector6d>{delta}));
  std::ranges::copy(block, x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kPoseSize, kPoseTangentSize, Eigen::RowMajor>>{jacobian}
      .setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Vector6d>{y_minus_x} = (from_block(x).inverse() * from_block(y)).log();
  return true;
}

bool PoseManifold::MinusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kPoseTangentSize, kPoseSize, Eigen::RowMajor>>{jacobian}
      .setIdentity();
  return true;
}

bool ReprojectionFactor::Evaluate(const double* const* parameters, double* residuals,
                                  double** jacobians) const {
  const CameraPoint point{parameters[0], parameters[1]};
  if (point.p_cam.z() < kMinimumDepthM) {
    return false;
  }
  Eigen::Map<Vector2d>{residuals} = (camera_.project(point.p_cam) - pixel_) / sigma_px_;
  point.chain<2>(camera_.project_jacobian(point.p_cam) / sigma_px_, jacobians);
  return true;
}

bool PointDepthFactor::Evaluate(const double* const* parameters, double* residuals,
                                double** jacobians) const {
  const CameraPoint point{parameters[0], parameters[1]};
  const double z = point.p_cam.z();
  if (z < kMinimumDepthM) {
    return false;
  }
  residuals[0] = (1 / z - 1 / depth_m_) / sigma_;
  point.chain<1>(Eigen::RowVector3d::UnitZ() / (-z * z * sigma_), jacobians);
  return true;
}

bool UprightFactor::Evaluate(const double* const* parameters, double* residuals,
                             double** jacobians) const {
  const Matrix3d R_odom_cam = from_block(parameters[0]).rotation_matrix();
  Eigen::Map<Vector3d>{residuals} = (R_odom_cam * up_cam_ - up_odom_) / sigma_rad_;
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    PoseJacobian<3> J{jacobians[0]};
    J.setZero();
    J.leftCols<3>() = -R_odom_cam * skew(up_cam_) / sigma_rad_;
  }
  return true;
}

RelativePoseFactor::RelativePoseFactor(const SE3& T_a_b, const Matrix6d& information)
    : T_b_a_{T_a_b.inverse()}, W_{root(information)} {}

bool RelativePoseFactor::Evaluate(const double* const* parameters, double* residuals,
                                  double** jacobians) const {
  (void)relative_error(T_b_a_, W_, parameters, residuals, jacobians);
  return true;
}

ReckonedFactor::ReckonedFactor(const SE3& T_a_b, const Matrix6d& information, const GyroTurn& gyro)
    : T_a_b_{T_a_b}, W_{root(information)}, gyro_{gyro} {}

bool ReckonedFactor::Evaluate(const double* const* parameters, double* residuals,
                              double** jacobians) const {
  const Vector3d turn = gyro_.correction(Eigen::Map<const Vector3d>{parameters[2]});
  const SE3 T_b_unbiased{so3::exp(turn), Vector3d::Zero()};
  const SE3 T_unbiased_a = (T_a_b_ * T_b_unbiased).inverse();  // frames: b as it is unbiased
  const Vector6d error = relative_error(T_unbiased_a, W_, parameters, residuals, jacobians);
  if (jacobians != nullptr && jacobians[2] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, kPoseTangentSize, 3, Eigen::RowMajor>>{jacobians[2]} =
        -W_ * SE3::right_jacobian_inverse(-error).leftCols<3>() * so3::right_jacobian(turn) *
        gyro_.per_bias;
  }
  return true;
}

bool BiasWalkFactor::Evaluate(const double* const* parameters, double* residuals,
                              double** jacobians) const {
  const Eigen::Map<const Vector3d> a{parameters[0]};
  const Eigen::Map<const Vector3d> b{parameters[1]};
  Eigen::Map<Vector3d>{residuals} = (b - a) / sigma_radps_;
  for (const int i : {0, 1}) {
    if (jacobians != nullptr && jacobians[i] != nullptr) {
      const double sign = i == 0 ? -1 : 1;
      Eigen::Map<Matrix3d>{jacobians[i]} = sign / sigma_radps_ * Matrix3d::Identity();
    }
  }
  return true;
}

BiasPriorFactor::BiasPriorFactor(const Vector3d& mean_radps, const Matrix3d& covariance)
    : mean_radps_{mean_radps}, W_{covariance.inverse().llt().matrixU()} {}

bool BiasPriorFactor::Evaluate(const double* const* parameters, double* residuals,
                               double** jacobians) const {
  Eigen::Map<Vector3d>{residuals} = W_ * (Eigen::Map<const Vector3d>{parameters[0]} - mean_radps_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{jacobians[0]} = W_;
  }
  return true;
}

}  // namespace geoflow::slam
