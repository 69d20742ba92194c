#pragma once

#include <cstddef>
#include <span>

#include "geoflow/hal/geometry.hpp"

#include "imu/noise_model.hpp"

namespace geoflow::calibration {

/// The noise of one axis, from its Allan variances.
struct NoiseFit {
  NoisePowers powers = NoisePowers::Zero();
  Matrix3d covariance = Matrix3d::Zero();  ///< of `powers`, as if they could be negative
  /// The shortest averaging time that the model was fitted to [periods]. What is shorter does not
  /// follow it: samples were filtered.
  std::size_t shortest = 1;
  /// Squared Mahalanobis distance of the variances from the model by degree of freedom; about 1
  /// where the noise is of the three kinds, and the covariance is made larger by it where it is
  /// more.
  double misfit = 0;
};

/// Fewest samples that fit_noise() takes.
inline constexpr std::size_t kFewestForNoise = 128;

/// Fits the three noises to overlapping Allan variances at averaging times of 1, 2, 4, ... periods
/// up to an eighth of the signal, by least squares weighted with their covariance under the model
/// itself (noise_model.hpp), iterated. Where the shortest times do not fit (1 in 10^4), they are
/// left out, up to 0.1 s. At least kFewestForNoise samples, not all equal. Pure.
[[nodiscard]] NoiseFit fit_noise(std::span<const double> signal, double period_s);

}  // namespace geoflow::calibration
