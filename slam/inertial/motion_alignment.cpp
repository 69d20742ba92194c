#include "inertial/motion_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "inertial/inertial_residual.hpp"
#include "inertial/initialiser.hpp"
#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"
#include "optimisation/matrix6.hpp"

namespace geoflow::slam {
namespace {

constexpr int kIterations = 10;
constexpr double kConverged = 1e-8;
constexpr int kGravitySize = 2;
constexpr std::size_t kLeastPoses = 3;

constexpr double kMostGravitySigma = 0.03;   // [rad]
constexpr double kMostVelocitySigma = 0.1;   // [m/s]
constexpr double kMostGyroBiasSigma = 0.01;  // [rad/s]
constexpr double kMostChiSquare = 3.0;

using MotionMatrix = Eigen::Matrix<double, kMotionSize, kMotionSize>;
using MotionVector = Eigen::Matrix<double, kMotionSize, 1>;

double worst_sigma(const Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen{covariance, Eigen::EigenvaluesOnly};
  return std::sqrt(std::max(0.0, eigen.eigenvalues().maxCoeff()));
}

/// Unknowns: rotation, translation and velocity of each pose, then the biases, then two tangents of
/// gravity's direction.
class Alignment {
 public:
  Alignment(std::span<const SeenPose> poses, std::span<const Preintegrated> between,
            const BiasPrior& prior)
      : poses_{poses},
        between_{between},
        prior_{prior},
        bias_at_{static_cast<Eigen::Index>(poses.size()) * kMotionSize},
        gravity_at_{bias_at_ + kBiasSize},
        size_{gravity_at_ + kGravitySize} {
    start();
  }

  void solve() {
    for (int i = 0; i < kIterations; ++i) {
      linearise();
      const Eigen::VectorXd step = -H_.ldlt().solve(b_);
      move(step);
      if (step.norm() < kConverged) {
        break;
      }
    }
    linearise();
  }

  [[nodiscard]] MotionFix fix() const {
    const Eigen::MatrixXd covariance = H_.ldlt().solve(Eigen::MatrixXd::Identity(size_, size_));
    const Eigen::Index newest_at = bias_at_ - kMotionSize;
    MotionFix fix;
    fix.gravity_odom = gravity_odom_;
    Matrix3d gravity = Matrix3d::Zero();
    gravity.topLeftCorner<kGravitySize, kGravitySize>() =
        covariance.bottomRightCorner<kGravitySize, kGravitySize>();
    fix.gravity_sigma_rad = worst_sigma(gravity);
    fix.states = states_;
    // The newest pose's unknowns and the biases stand side by side, in a state's order.
    fix.covariance = covariance.block<kStateSize, kStateSize>(newest_at, newest_at);
    const auto rows = static_cast<double>(between_.size() * kMotionSize +
                                          poses_.size() * kVelocityAt + kBiasSize);
    fix.chi_square_per_dof = chi_square_ / (rows - static_cast<double>(size_));
    return fix;
  }

 private:
  /// Gravity from what the IMU says the velocity should have changed by, over all intervals.
  void start() {
    Vector3d force = Vector3d::Zero();
    for (std::size_t i = 0; i < between_.size(); ++i) {
      const Preintegrated::Increments increments = between_[i].at(prior_.bias);
      const Eigen::Quaterniond& R_odom_imu = poses_[i].T_odom_imu.rotation();
      force += R_odom_imu * increments.dv;
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      states_.push_back(
          {.T_odom_imu = poses_[i].T_odom_imu, .v_odom = chord(i), .bias = prior_.bias});
    }
    const Vector3d gained = states_.back().v_odom - states_.front().v_odom;
    gravity_odom_ = kStandardGravity * (gained - force).normalized();
  }

  /// Velocity by the difference of the neighbours' positions.
  [[nodiscard]] Vector3d chord(std::size_t i) const {
    const std::size_t from = i == 0 ? 0 : i - 1;
    const std::size_t to = std::min(i + 1, poses_.size() - 1);
    double dt_s = 0;
    for (std::size_t k = from; k < to; ++k) {
      dt_s += between_[k].dt_s;
    }
    return (poses_[to].T_odom_imu.translation() - poses_[from].T_odom_imu.translation()) / dt_s;
  }

  /// Orthogonal directions in which gravity can turn, with unit length for 1 rad.
  [[nodiscard]] Eigen::Matrix<double, 3, kGravitySize> gravity_tangents() const {
    const Vector3d down = gravity_odom_.normalized();
    Eigen::Matrix<double, 3, kGravitySize> E;
    E.col(0) = down.unitOrthogonal();
    E.col(1) = down.cross(E.col(0));
    return kStandardGravity * E;
  }

  void linearise() {
    H_.setZero(size_, size_);
    b_.setZero(size_);
    chi_square_ = 0;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      add_pose(i);
    }
    for (std::size_t i = 0; i < between_.size(); ++i) {
      add_motion(i);
    }
    const BiasMatrix information = inverse(prior_.covariance);
    const Vector6d error = states_.front().bias.vector() - prior_.bias.vector();
    H_.block<kBiasSize, kBiasSize>(bias_at_, bias_at_) += information;
    b_.segment<kBiasSize>(bias_at_) += information * error;
    chi_square_ += error.dot(information * error);
  }

  void add_pose(std::size_t i) {
    const auto at = static_cast<Eigen::Index>(i) * kMotionSize;
    const SE3& T_odom_seen = poses_[i].T_odom_imu;
    const Vector6d error = (T_odom_seen.inverse() * states_[i].T_odom_imu).log();
    const Matrix6d J = SE3::right_jacobian_inverse(error);
    Vector6d weight;
    weight << Vector3d::Constant(1 / poses_[i].rotation_sigma_rad),
        Vector3d::Constant(1 / poses_[i].translation_sigma_m);
    const Vector6d information = weight.cwiseAbs2();
    H_.block<6, 6>(at, at) += J.transpose() * information.asDiagonal() * J;
    b_.segment<6>(at) += J.transpose() * information.cwiseProduct(error);
    chi_square_ += error.dot(information.cwiseProduct(error));
  }

  void add_motion(std::size_t i) {
    const auto first = static_cast<Eigen::Index>(i) * kMotionSize;
    const InertialResidual residual =
        inertial_residual(between_[i], states_[i], states_[i + 1], gravity_odom_);
    const MotionMatrix covariance =
        between_[i].covariance.topLeftCorner<kMotionSize, kMotionSize>();
    const MotionMatrix information = covariance.inverse();
    // Columns: both states' motion, biases, gravity.
    constexpr int kBoth = 2 * kMotionSize;
    Eigen::MatrixXd J{kMotionSize, kBoth + kBiasSize + kGravitySize};
    J << residual.by_first.topLeftCorner<kMotionSize, kMotionSize>(),
        residual.by_second.topLeftCorner<kMotionSize, kMotionSize>(),
        residual.by_first.topRightCorner<kMotionSize, kBiasSize>(),
        residual.by_gravity.topRows<kMotionSize>() * gravity_tangents();
    const MotionVector error = residual.value.head<kMotionSize>();
    const Eigen::MatrixXd weighted = J.transpose() * information;
    const Eigen::MatrixXd h = weighted * J;
    const Eigen::VectorXd g = weighted * error;
    constexpr int kShared = kBiasSize + kGravitySize;
    H_.block<kBoth, kBoth>(first, first) += h.topLeftCorner<kBoth, kBoth>();
    H_.block<kBoth, kShared>(first, bias_at_) += h.topRightCorner<kBoth, kShared>();
    H_.block<kShared, kBoth>(bias_at_, first) += h.bottomLeftCorner<kShared, kBoth>();
    H_.block<kShared, kShared>(bias_at_, bias_at_) += h.bottomRightCorner<kShared, kShared>();
    b_.segment<kBoth>(first) += g.head<kBoth>();
    b_.segment<kShared>(bias_at_) += g.tail<kShared>();
    chi_square_ += error.dot(information * error);
  }

  void move(const Eigen::VectorXd& step) {
    for (std::size_t i = 0; i < states_.size(); ++i) {
      StateVector delta;
      delta << step.segment<kMotionSize>(static_cast<Eigen::Index>(i) * kMotionSize),
          step.segment<kBiasSize>(bias_at_);
      states_[i] = states_[i].plus(delta);
    }
    const Vector3d turned = gravity_odom_ + gravity_tangents() * step.tail<kGravitySize>();
    gravity_odom_ = kStandardGravity * turned.normalized();
  }

  std::span<const SeenPose> poses_;
  std::span<const Preintegrated> between_;
  const BiasPrior& prior_;
  Eigen::Index bias_at_;
  Eigen::Index gravity_at_;
  Eigen::Index size_;
  std::vector<NavState> states_;
  Vector3d gravity_odom_ = Vector3d::Zero();
  Eigen::MatrixXd H_;
  Eigen::VectorXd b_;
  double chi_square_ = 0;
};

}  // namespace

Result<MotionFix> align_motion(std::span<const SeenPose> poses,
                               std::span<const Preintegrated> between, const BiasPrior& prior) {
  if (poses.size() < kLeastPoses || between.size() + 1 != poses.size()) {
    return fail(ErrorCode::kInvalidArgument,
                "{} poses with {} increments between them; it takes at least {} with one fewer",
                poses.size(), between.size(), kLeastPoses);
  }
  Alignment alignment{poses, between, prior};
  alignment.solve();
  MotionFix fix = alignment.fix();
  // The comparisons are false for what is not a number.
  if (!(fix.chi_square_per_dof < kMostChiSquare)) {
    return fail(ErrorCode::kUnavailable, "IMU and poses disagree: chi-square {:.1f} per dimension",
                fix.chi_square_per_dof);
  }
  const double velocity_sigma = worst_sigma(fix.covariance.block<3, 3>(kVelocityAt, kVelocityAt));
  const double gyro_sigma = worst_sigma(fix.covariance.block<3, 3>(kGyroBiasAt, kGyroBiasAt));
  if (!(fix.gravity_sigma_rad < kMostGravitySigma && velocity_sigma < kMostVelocitySigma &&
        gyro_sigma < kMostGyroBiasSigma)) {
    return fail(ErrorCode::kUnavailable,
                "not observable yet: gravity to {:.3f} rad, velocity to {:.2f} m/s, gyro bias to "
                "{:.3f} rad/s",
                fix.gravity_sigma_rad, velocity_sigma, gyro_sigma);
  }
  return fix;
}

}  // namespace geoflow::slam
