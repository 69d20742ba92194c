#pragma once

#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

/// How the noise of one axis of an IMU shows in its Allan variance, and how surely.
///
/// The noise is the sum of three (IEEE Std 952-1997, annex C): white noise of density N, flicker of
/// bias instability B, and a random walk of density K. Their powers (N^2, B^2, K^2) enter linearly:
///
///     sigma^2(tau) = N^2 / tau + B^2 2 ln 2 / pi + K^2 tau / 3
namespace geoflow::calibration {

/// (N^2, B^2, K^2), none negative.
using NoisePowers = Vector3d;

/// Row i: what each power's unit contributes to the Allan variance at factor i times `period_s`.
[[nodiscard]] Eigen::MatrixX3d allan_design(std::span<const std::size_t> factors, double period_s);

/// The covariance of the overlapping Allan variances at `factors` (ascending) of `count` samples
/// with noise of `powers`.
///
/// An Allan variance is the mean square of differences d(k) that are Gaussian, so that the
/// covariance of two is the mean of 2 cov(d_a(k), d_b(l))^2 over k and l (Isserlis' theorem; as S.
/// Guerrier and others use it, "Wavelet-variance-based estimation for composite stochastic
/// processes", JASA 2013). The differences weigh the integrated signal at three instants, so their
/// covariances are second differences of the function whose second derivative is the noise's
/// (generalised) autocovariance: |t|/2, -t^2 ln|t| / (2 pi) and -|t|^3/12 by unit of power.
[[nodiscard]] Eigen::MatrixXd allan_covariance(const NoisePowers& powers,
                                               std::span<const std::size_t> factors,
                                               std::size_t count, double period_s);

}  // namespace geoflow::calibration
