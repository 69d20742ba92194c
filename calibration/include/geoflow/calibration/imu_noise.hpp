#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/calibration/allan.hpp"
#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// The noise of an IMU from a recording in which it stands still. Pure functions, thread-safe.
namespace geoflow::calibration {

/// One of the three kinds of noise on one axis, or the mean power over a sensor's axes. The unit of
/// a power is the square of the density's.
struct NoiseTerm {
  double power = 0;        ///< not negative
  double power_sigma = 0;  ///< one standard deviation

  /// The density: root of the power.
  [[nodiscard]] double value() const noexcept;
  /// One standard deviation of the density, where it is determined.
  [[nodiscard]] double sigma() const noexcept;
  /// Whether the power differs from none by three standard deviations.
  [[nodiscard]] bool determined() const noexcept;
  /// What the density is below of, with 97.7 %: two standard deviations more power than found.
  [[nodiscard]] double upper_bound() const noexcept;
};

/// The kinds of noise (IEEE Std 952-1997, annex C). Densities of an accelerometer:
/// [m/s^2/sqrt(Hz)], [m/s^2], [m/s^3/sqrt(Hz)]; of a gyroscope [rad/s/sqrt(Hz)], [rad/s],
/// [rad/s^2/sqrt(Hz)].
struct NoiseTerms {
  NoiseTerm white{};             ///< N: the Allan deviation at 1 s is N where it dominates
  NoiseTerm bias_instability{};  ///< B: the curve is flat at 0.664 B where it dominates
  NoiseTerm random_walk{};       ///< K, of the bias
};

struct AxisNoise {
  NoiseTerms terms{};
  std::vector<AllanPoint> curve{};  ///< four points to an octave, up to half the recording
  /// Averaging times below this do not follow the model, as with filtered samples, and were left
  /// out.
  double shortest_tau_s = 0;
  /// Squared distance of the curve from the model by degree of freedom, in units of its
  /// covariance; the standard deviations are made larger by it.
  double misfit = 0;
  std::size_t distinct_values = 0;  ///< how many different values the axis says; at most 16 counted
};

struct ImuNoiseEstimate {
  double rate_hz = 0;
  HostTime begin{};   ///< of the stretch that was used
  Duration length{};  ///< of it
  std::size_t samples = 0;
  std::size_t filled = 0;           ///< of them, missing in the recording
  std::array<AxisNoise, 6> axes{};  ///< accelerometer x, y, z, gyroscope x, y, z
  NoiseTerms accel{};               ///< mean powers of the three axes, what Kalibr's imu.yaml wants
  NoiseTerms gyro{};
};

struct ImuNoiseOptions {
  /// Shortest time of standing still that is accepted [s].
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double min_still_s = 60;
};

/// Looks for the longest stretch in which the IMU stands still, and estimates the noise in it from
/// the overlapping Allan deviation (noise_fit.hpp in imu/). Errors (kInvalidData): samples that
/// cannot be used, with their number; a stretch that is too short, with where it is; too many
/// missing samples; an axis that does not change, or whose white noise does not show.
[[nodiscard]] Result<ImuNoiseEstimate> estimate_imu_noise(std::span<const Timed<ImuSample>> samples,
                                                          const ImuNoiseOptions& options);

/// "accel_x" to "gyro_z".
[[nodiscard]] const char* imu_axis_name(std::size_t axis) noexcept;

/// Each sensor's densities and each axis' with their verdicts: accel.white_noise, …,
/// gyro_z.random_walk. PASS: white noise to 2.5 %, random walk to 30 %, a curve that follows the
/// model.
[[nodiscard]] std::vector<Finding> judge(const ImuNoiseEstimate& estimate);

}  // namespace geoflow::calibration
