#pragma once

#include <cstddef>
#include <deque>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

/// Attitude and biases of an IMU that stands still, from nothing but its samples.
namespace geoflow::slam {

/// What is believed of the biases before anything was measured: a warm start's saved biases, or
/// the sensor's datasheet.
struct BiasPrior {
  ImuBias bias{};
  BiasMatrix covariance = BiasMatrix::Identity();  ///< of (gyro, accel)

  /// Nothing is known but the kind of sensor. Standard deviations 0.05 rad/s (EuRoC's ADIS16448
  /// has 0.08 on one axis; the BMI055 of a D435i is within 0.017) and 0.2 m/s^2 (BMI085: 20 mg;
  /// BMI055: 70 mg at most).
  [[nodiscard]] static BiasPrior cold();
};

/// What standing still tells. The accelerometer's bias across gravity cannot be told from a tilt
/// (0.02 rad at the cold prior's 0.2 m/s^2): that is in the covariance, and so are their
/// correlations.
struct StandingFix {
  HostTime t;        ///< of the last sample used
  Duration stood{};  ///< time that was averaged
  /// Odom's z points up, and the forward axis of the initialiser lies in its half plane x > 0,
  /// y = 0: yaw is 0 by definition.
  Eigen::Quaterniond R_odom_imu = Eigen::Quaterniond::Identity();
  ImuBias bias{};
  /// Of (rotation, gyro bias, accel bias): a right perturbation of R_odom_imu, without its
  /// component about the vertical, which is exact.
  Eigen::Matrix<double, kMotionSize, kMotionSize> covariance =
      Eigen::Matrix<double, kMotionSize, kMotionSize>::Zero();
  bool prior_rejected = false;  ///< the prior contradicts the samples; the cold one was used
};

/// The rotation whose z is `up_imu` (unit) and that turns `forward_imu` into the half plane x > 0,
/// y = 0; any heading where the two are parallel.
[[nodiscard]] Eigen::Quaterniond level_rotation(const Vector3d& up_imu,
                                                const Vector3d& forward_imu);

/// Watches samples until the IMU stands still for a second, then averages for up to five.
///
/// Standing is a test on the means of blocks of 50 ms, in which the vibration of motors (a robot
/// that stands under control, a drone on the ground with its rotors on) averages out while the
/// motion of a body remains: their standard deviation, and the difference between the older and the
/// newer half, stay under bounds that lie between what was measured on standing and on moving
/// robots. A turn about the vertical at a constant rate below 0.1 rad/s cannot be told from a bias
/// unless the prior says better. Thread-compatible.
class StandingInitialiser {
 public:
  /// `forward_imu`: the axis in the imu frame that odom's x shall lie under.
  explicit StandingInitialiser(const ImuNoise& noise, const BiasPrior& prior = BiasPrior::cold(),
                               const Vector3d& forward_imu = Vector3d::UnitX());

  /// Takes a sample. One that is not newer than the last is ignored (packets overlap), and so is
  /// one that is not finite. A gap of more than 0.1 s begins anew.
  void add(HostTime t, const ImuSample& sample);

  /// Whether the last second was standing.
  [[nodiscard]] bool standing() const;

  /// The fix from the time stood so far, at least a second. Errors (kUnavailable) say what is
  /// missing: moving, not long enough, or a specific force that is not gravity's.
  [[nodiscard]] Result<StandingFix> fix() const;

 private:
  /// (gyro, accel) over 50 ms.
  struct Block {
    HostTime t_begin;
    HostTime t_end;
    Vector6d sum = Vector6d::Zero();  ///< then the mean
    Vector6d sum_of_squares = Vector6d::Zero();
    std::size_t samples = 0;
  };

  void close_block();
  void restart();
  [[nodiscard]] Vector6d mean(std::size_t first, std::size_t last) const;
  [[nodiscard]] bool blocks_agree() const;
  /// Of the mean over `seconds`, by the sensor's noise alone.
  [[nodiscard]] Vector6d white_variance(double seconds) const;
  [[nodiscard]] Vector6d variance_of_mean() const;
  [[nodiscard]] StandingFix solve(const BiasPrior& prior, const Vector6d& mean,
                                  const Vector6d& variance) const;

  ImuNoise noise_;
  BiasPrior prior_;
  Vector3d forward_imu_;
  Block open_;
  std::deque<Block> blocks_;
};

}  // namespace geoflow::slam
