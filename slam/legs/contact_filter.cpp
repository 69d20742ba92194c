#include "legs/contact_filter.hpp"

#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/up_direction.hpp"

namespace geoflow::slam {
namespace {

int foothold_block(std::size_t leg) {
  return ContactFilter::kFoothold + 3 * static_cast<int>(leg);
}

int foothold_block(Leg leg) {
  return foothold_block(static_cast<std::size_t>(leg));
}

/// The group's exponential of an error: a rotation, whose left Jacobian translations pass through.
struct GroupStep {
  explicit GroupStep(const Vector3d& phi) : rotation{so3::exp(phi)}, V{so3::right_jacobian(-phi)} {}

  [[nodiscard]] Vector3d moved(const Vector3d& x, const Vector3d& delta) const {
    return rotation * x + V * delta;
  }

  Eigen::Quaterniond rotation;
  Matrix3d V;
};

}  // namespace

void ContactFilter::reset(const LeggedState& state, const Covariance& covariance) {
  state_ = state;
  covariance_ = covariance;
  state_.q_odom_begin = state_.q_odom_imu;
  state_.p_odom_begin = state_.p_odom;
  for (const auto& [to, from] : {std::pair{int{kBeginAttitude}, int{kAttitude}},
                                 std::pair{int{kBeginPosition}, int{kPosition}}}) {
    covariance_.middleRows<3>(to) = covariance_.middleRows<3>(from).eval();
    covariance_.middleCols<3>(to) = covariance_.middleCols<3>(from).eval();
  }
}

void ContactFilter::widen_velocity(double sigma_mps) {
  covariance_.diagonal().segment<3>(kVelocity).array() += sigma_mps * sigma_mps;
}

void ContactFilter::propagate(const ImuSample& mean, double dt_s, const StepNoise& noise) {
  const Vector3d rotation = (mean.gyro_radps - state_.bias_gyro) * dt_s;
  const Eigen::Quaterniond q_middle = state_.q_odom_imu * so3::exp(0.5 * rotation);
  const Vector3d a_odom = q_middle * (mean.accel_mps2 - state_.bias_accel) + gravity_down();
  const Matrix3d R = q_middle.toRotationMatrix();

  // The transition, exact to second order in dt.
  Covariance F = Covariance::Identity();
  F.block<3, 3>(kVelocity, kAttitude) = skew(gravity_down()) * dt_s;
  F.block<3, 3>(kPosition, kAttitude) = 0.5 * skew(gravity_down()) * dt_s * dt_s;
  F.block<3, 3>(kPosition, kVelocity) = Matrix3d::Identity() * dt_s;
  F.block<3, 3>(kAttitude, kGyroBias) = -R * dt_s;
  const Vector3d v_middle = state_.v_odom + 0.5 * a_odom * dt_s;
  const Vector3d p_middle = state_.p_odom + 0.5 * v_middle * dt_s;
  F.block<3, 3>(kVelocity, kGyroBias) =
      -(skew(v_middle) * dt_s + 0.5 * skew(gravity_down()) * dt_s * dt_s) * R;
  F.block<3, 3>(kPosition, kGyroBias) =
      -(skew(p_middle) * dt_s + 0.5 * skew(v_middle) * dt_s * dt_s) * R;
  F.block<3, 3>(kVelocity, kAccelBias) = -R * dt_s;
  F.block<3, 3>(kPosition, kAccelBias) = -0.5 * R * dt_s * dt_s;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    F.block<3, 3>(foothold_block(leg), kGyroBias) = -skew(state_.footholds.at(leg)) * R * dt_s;
  }
  // Only attitude, velocity and biases drive others: F P F^T by those columns of F alone.
  constexpr int kDrivers = 6;
  const Covariance D = F - Covariance::Identity();
  const auto driven = [&](const Covariance& P) -> Covariance {
    return P + D.leftCols<kDrivers>() * P.topRows<kDrivers>() +
           D.middleCols<kDrivers>(kGyroBias) * P.middleRows<kDrivers>(kGyroBias);
  };
  covariance_ = driven(driven(covariance_).transpose());

  // The gyroscope's noise enters wherever its bias does; the accelerometer's as its bias.
  const Eigen::Matrix<double, kErrorSize, 3> by_gyro = D.middleCols<3>(kGyroBias);
  const Eigen::Matrix<double, kErrorSize, 3> by_accel = D.middleCols<3>(kAccelBias);
  covariance_ += by_gyro * (noise.gyro * noise.gyro / dt_s) * by_gyro.transpose();
  covariance_ += by_accel * (noise.accel * noise.accel / dt_s) * by_accel.transpose();
  const auto add = [&](int block, const Vector3d& density) {
    covariance_.diagonal().segment<3>(block) += density.cwiseAbs2() * dt_s;
  };
  add(kGyroBias, Vector3d::Constant(noise.gyro_walk));
  add(kAccelBias, Vector3d::Constant(noise.accel_walk));
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    add(foothold_block(leg), noise.foothold.at(leg));
  }

  state_.p_odom += v_middle * dt_s;
  state_.v_odom += a_odom * dt_s;
  state_.q_odom_imu = (state_.q_odom_imu * so3::exp(rotation)).normalized();
}

void ContactFilter::touch_down(Leg leg, const Vector3d& foot_in_imu, const Matrix3d& covariance) {
  const Matrix3d R = state_.q_odom_imu.toRotationMatrix();
  state_.footholds.at(static_cast<std::size_t>(leg)) = state_.p_odom + R * foot_in_imu;
  const int block = foothold_block(leg);
  covariance_.middleRows<3>(block) = covariance_.middleRows<3>(kPosition).eval();
  covariance_.middleCols<3>(block) = covariance_.middleCols<3>(kPosition).eval();
  covariance_.block<3, 3>(block, block) += R * covariance * R.transpose();
}

void ContactFilter::roll(Leg leg, const Vector3d& displacement) {
  state_.footholds.at(static_cast<std::size_t>(leg)) += displacement;
}

double ContactFilter::update_foothold(Leg leg, const Vector3d& foot_in_imu,
                                      const Matrix3d& covariance, double gate) {
  const Matrix3d R = state_.q_odom_imu.toRotationMatrix();
  const Vector3d innovation =
      R * foot_in_imu + state_.p_odom - state_.footholds.at(static_cast<std::size_t>(leg));
  Gain H = Gain::Zero();
  H.block<3, 3>(0, kPosition) = -Matrix3d::Identity();
  H.block<3, 3>(0, foothold_block(leg)) = Matrix3d::Identity();
  return correct(H, innovation, R * covariance * R.transpose(), gate);
}

double ContactFilter::update_velocity(const Vector3d& v_imu, const Matrix3d& covariance,
                                      double gate) {
  const Matrix3d R = state_.q_odom_imu.toRotationMatrix();
  Gain H = Gain::Zero();
  H.block<3, 3>(0, kVelocity) = Matrix3d::Identity();
  return correct(H, R * v_imu - state_.v_odom, R * covariance * R.transpose(), gate);
}

double ContactFilter::update_gyro_bias(const Vector3d& gyro_radps, const Matrix3d& covariance) {
  Gain H = Gain::Zero();
  H.block<3, 3>(0, kGyroBias) = Matrix3d::Identity();
  return correct(H, gyro_radps - state_.bias_gyro, covariance,
                 std::numeric_limits<double>::infinity());
}

double ContactFilter::correct(const Gain& H, const Vector3d& innovation, const Matrix3d& noise,
                              double gate) {
  const Eigen::Matrix<double, kErrorSize, 3> covariance_z = covariance_ * H.transpose();
  const Matrix3d S = H * covariance_z + noise;
  const Matrix3d information = S.inverse();
  const double nis = innovation.dot(information * innovation);
  // Written so that NaN is refused as well.
  if (!(nis <= gate)) {
    return nis;
  }
  const Eigen::Matrix<double, kErrorSize, 3> K = covariance_z * information;
  const Eigen::Matrix<double, kErrorSize, 1> delta = K * innovation;
  covariance_ -= K * covariance_z.transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();

  const GroupStep now{delta.segment<3>(kAttitude)};
  state_.q_odom_imu = (now.rotation * state_.q_odom_imu).normalized();
  state_.v_odom = now.moved(state_.v_odom, delta.segment<3>(kVelocity));
  state_.p_odom = now.moved(state_.p_odom, delta.segment<3>(kPosition));
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    Vector3d& foothold = state_.footholds.at(leg);
    foothold = now.moved(foothold, delta.segment<3>(foothold_block(leg)));
  }
  const GroupStep begin{delta.segment<3>(kBeginAttitude)};
  state_.q_odom_begin = (begin.rotation * state_.q_odom_begin).normalized();
  state_.p_odom_begin = begin.moved(state_.p_odom_begin, delta.segment<3>(kBeginPosition));
  state_.bias_gyro += delta.segment<3>(kGyroBias);
  state_.bias_accel += delta.segment<3>(kAccelBias);
  return nis;
}

SE3 ContactFilter::way() const {
  return SE3{state_.q_odom_begin, state_.p_odom_begin}.inverse() *
         SE3{state_.q_odom_imu, state_.p_odom};
}

Matrix6d ContactFilter::pose_covariance() const {
  // phi = R^T delta_R, rho = R^T (delta_p - p x delta_R): see the error's definition.
  const Matrix3d R_imu_odom = state_.q_odom_imu.toRotationMatrix().transpose();
  using ToPose = Eigen::Matrix<double, 6, kGyroBias>;
  ToPose J = ToPose::Zero();
  J.block<3, 3>(0, kAttitude) = R_imu_odom;
  J.block<3, 3>(3, kAttitude) = -R_imu_odom * skew(state_.p_odom);
  J.block<3, 3>(3, kPosition) = R_imu_odom;
  return J * covariance_.topLeftCorner<kGyroBias, kGyroBias>() * J.transpose();
}

UpDirection ContactFilter::up() const {
  const Matrix3d of_bias = covariance_.block<3, 3>(kAccelBias, kAccelBias);
  const Matrix3d with_bias = covariance_.block<3, 3>(kAttitude, kAccelBias);
  const Matrix3d attitude_per_bias = of_bias.ldlt().solve(with_bias.transpose()).transpose();
  const Matrix3d given_bias =
      covariance_.block<3, 3>(kAttitude, kAttitude) - attitude_per_bias * with_bias.transpose();
  const Matrix3d R_imu_odom = state_.q_odom_imu.toRotationMatrix().transpose();
  return {.up = R_imu_odom.col(2),
          .variance = given_bias.topLeftCorner<2, 2>().trace() / 2,
          .per_bias = R_imu_odom * skew(Vector3d::UnitZ()) * attitude_per_bias,
          .bias = state_.bias_accel,
          .bias_covariance = of_bias};
}

Matrix3d ContactFilter::velocity_covariance() const {
  Eigen::Matrix<double, 3, 6> J;
  J << -skew(state_.v_odom), Matrix3d::Identity();
  return J * covariance_.topLeftCorner<6, 6>() * J.transpose();
}

}  // namespace geoflow::slam
