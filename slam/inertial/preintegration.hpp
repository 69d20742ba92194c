#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

/// On-manifold preintegration of IMU samples between two instants.
///
/// Source: Forster, Carlone, Dellaert, Scaramuzza, "On-Manifold Preintegration for Real-Time
/// Visual-Inertial Odometry", T-RO 2017, DOI 10.1109/TRO.2016.2597321; equation numbers below are
/// its. Paper (GeoFlow-SLAM) equation (4).
namespace geoflow::slam {

/// A sample as preintegration takes it: with what the screen (screen.hpp) says of its noise.
struct InertialSample {
  HostTime t;
  ImuSample sample;
  double gyro_variance_radps2 = 0;  ///< added to the noise of this sample, per axis [rad^2/s^2]
  double accel_variance_m2ps4 = 0;  ///< likewise [m^2/s^4]
};

/// Samples taken as they are, for sources that are trusted: simulations, recordings that were
/// checked.
[[nodiscard]] std::vector<InertialSample> unscreened(std::span<const Timed<ImuSample>> samples);

/// Motion between instants i and j as the IMU alone tells it, free of the state at i. imu0 is the
/// imu frame at i, imu1 at j.
struct Preintegrated {
  using BiasJacobian = Eigen::Matrix<double, kMotionSize, kBiasSize>;

  HostTime t_begin;
  HostTime t_end;
  double dt_s = 0;
  Eigen::Quaterniond R_imu0_imu1 = Eigen::Quaterniond::Identity();  ///< (33), first line
  Vector3d dp = Vector3d::Zero();  ///< (33): position without gravity and first velocity [m]
  Vector3d dv = Vector3d::Zero();  ///< (33): velocity without gravity [m/s]
  ImuBias bias{};                  ///< at which it was integrated
  /// Derivative of (rotation, dp, dv) by (gyro, accel) bias; the rotation's is a right
  /// perturbation.
  BiasJacobian by_bias = BiasJacobian::Zero();
  /// Of (rotation, dp, dv, gyro bias walk, accel bias walk) by samples' noise and the biases'
  /// random walk from i to j, 15 x 15.
  StateMatrix covariance = StateMatrix::Zero();
  Duration longest_gap{};  ///< longest time without a sample in [t_begin, t_end]

  /// The increments as they would be at another bias, to first order (44). Good for changes up to
  /// some 0.02 rad/s and 0.2 m/s^2; beyond, integrate again.
  struct Increments {
    Eigen::Quaterniond R_imu0_imu1;
    Vector3d dp;
    Vector3d dv;
  };
  [[nodiscard]] Increments at(const ImuBias& other) const;
};

/// Integrates `samples` over [t_begin, t_end] at `bias`. Thread-safe.
///
/// Between two samples, specific force in the first frame and angular velocity are taken as linear
/// in time (second-order Magnus expansion for the rotation), and at both ends samples are
/// interpolated: `samples` are a SyncedPacket's, in order, with one at or before t_begin and one
/// at or after t_end; where that one is missing, the nearest is held.
///
/// The covariance has three sources: the samples' white noise and bias walk (`noise`), what the
/// screen adds, and what a signal does unseen between samples. That is a Brownian bridge: its mean
/// over a step differs from the samples' by step^2 / 12, with the step as measured where it stands
/// out of the noise, and that of a walking robot in a gap. So shocks and lost samples weigh less.
///
/// Errors (kUnavailable): no samples, an empty interval, or more than 0.1 s of it without a sample.
[[nodiscard]] Result<Preintegrated> preintegrate(std::span<const InertialSample> samples,
                                                 HostTime t_begin, HostTime t_end,
                                                 const ImuBias& bias, const ImuNoise& noise);

}  // namespace geoflow::slam
