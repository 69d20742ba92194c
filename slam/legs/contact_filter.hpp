#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

#include "inertial/up_direction.hpp"

namespace geoflow::slam {

/// The body of a legged robot with its footholds, as the filter below estimates it.
struct LeggedState {
  Eigen::Quaterniond q_odom_imu = Eigen::Quaterniond::Identity();
  Vector3d v_odom = Vector3d::Zero();  ///< of the IMU [m/s]
  Vector3d p_odom = Vector3d::Zero();  ///< of the IMU [m]
  Vector3d bias_gyro = Vector3d::Zero();
  Vector3d bias_accel = Vector3d::Zero();
  /// In odom [m]; of no meaning without contact.
  std::array<Vector3d, kLegCount> footholds{Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(),
                                            Vector3d::Zero()};
  /// Where it was when it began, as it is known now.
  Eigen::Quaterniond q_odom_begin = Eigen::Quaterniond::Identity();
  Vector3d p_odom_begin = Vector3d::Zero();  ///< [m]
};

/// Contact-aided right-invariant extended Kalman filter of IMU and leg kinematics.
/// Source: Hartley, Ghaffari, Eustice, Grizzle, "Contact-aided invariant extended Kalman filtering
/// for robot state estimation", IJRR 2020. Differences: footholds are the centres of spherical feet
/// and roll with a given displacement; each has its own process noise; all four have a fixed place
/// in the state; so has a clone of the first pose (Roumeliotis and Burdick, "Stochastic cloning",
/// ICRA 2002), from which the way since then is told: what is learnt of the tilt later turns both,
/// and is no motion.
///
/// The error of state X is X_true = exp(delta) X_estimated, in odom's axes: attitude, velocity,
/// position, then biases (additive), then footholds, then the clone's attitude and position. Yaw
/// and position of the origin stay unobservable in this error whatever the estimate, which keeps
/// the covariance consistent. odom's z points up. Thread-compatible.
class ContactFilter {
 public:
  static constexpr int kErrorSize = 21 + 3 * static_cast<int>(kLegCount);
  /// Where the blocks of the error begin; the foothold of leg l begins at kFoothold + 3 l.
  enum Block { kAttitude = 0, kVelocity = 3, kPosition = 6, kGyroBias = 9, kAccelBias = 12 };
  static constexpr int kFoothold = 15;
  static constexpr int kBeginAttitude = kFoothold + 3 * static_cast<int>(kLegCount);
  static constexpr int kBeginPosition = kBeginAttitude + 3;
  using Covariance = Eigen::Matrix<double, kErrorSize, kErrorSize>;

  /// Continuous-time noise densities and the footholds' own motion over one step.
  struct StepNoise {
    double gyro = 0;        ///< [rad/s/sqrt(Hz)]
    double accel = 0;       ///< [m/s^2/sqrt(Hz)]
    double gyro_walk = 0;   ///< [rad/s^2/sqrt(Hz)]
    double accel_walk = 0;  ///< [m/s^3/sqrt(Hz)]
    /// Random walk along odom's axes [m/sqrt(s)].
    std::array<Vector3d, kLegCount> foothold{Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(),
                                             Vector3d::Zero()};
  };

  /// The clone begins as the pose, whatever is given of it.
  void reset(const LeggedState& state, const Covariance& covariance);

  /// Adds an unknown velocity with this standard deviation [m/s].
  void widen_velocity(double sigma_mps);

  /// Moves on by `dt_s` with the IMU's mean over that time (not corrected for bias).
  void propagate(const ImuSample& mean, double dt_s, const StepNoise& noise);

  /// Begins a foothold at `foot_in_imu`, known up to `covariance` (in imu).
  void touch_down(Leg leg, const Vector3d& foot_in_imu, const Matrix3d& covariance);

  /// Moves a foothold, as a rolling foot does [m, in odom].
  void roll(Leg leg, const Vector3d& displacement);

  /// One foot's place measured by the kinematics. Returns the normalised innovation squared (3
  /// degrees of freedom); where it exceeds `gate`, nothing is changed.
  double update_foothold(Leg leg, const Vector3d& foot_in_imu, const Matrix3d& covariance,
                         double gate);

  /// The IMU's velocity in its own axes measured. Returned and refused as above.
  double update_velocity(const Vector3d& v_imu, const Matrix3d& covariance, double gate);

  /// The gyroscope at rest: a measurement of its bias. Returned as above.
  double update_gyro_bias(const Vector3d& gyro_radps, const Matrix3d& covariance);

  [[nodiscard]] const LeggedState& state() const noexcept { return state_; }
  /// Of the error described above.
  [[nodiscard]] const Covariance& covariance() const noexcept { return covariance_; }

  /// Covariance of the pose T_odom_imu as hal/geometry.hpp defines it.
  [[nodiscard]] Matrix6d pose_covariance() const;
  /// Which way is up in the imu frame.
  [[nodiscard]] UpDirection up() const;
  /// T_begin_imu, the IMU's motion since reset().
  [[nodiscard]] SE3 way() const;
  /// Of the velocity in odom.
  [[nodiscard]] Matrix3d velocity_covariance() const;

 private:
  using Gain = Eigen::Matrix<double, 3, kErrorSize>;
  double correct(const Gain& H, const Vector3d& innovation, const Matrix3d& noise, double gate);

  LeggedState state_;
  Covariance covariance_ = Covariance::Zero();
};

}  // namespace geoflow::slam
