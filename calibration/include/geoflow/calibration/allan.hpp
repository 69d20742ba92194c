#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace geoflow::calibration {

/// One point of an Allan deviation curve, in the signal's unit.
struct AllanPoint {
  double tau_s = 0;  ///< averaging time
  double deviation = 0;
  double variance = 0;    ///< its square
  std::size_t terms = 0;  ///< overlapping differences that it is the mean of
};

/// The overlapping Allan deviation of a signal (a rate, not an angle) sampled every `period_s`,
/// over averaging times of `factors` periods each (>= 1):
///
///     sigma^2(m tau0) = 1/2 < (mean of the m samples from k + m on - mean of the m from k on)^2 >
///
/// over all k. Factors of which the signal is not twice as long are left out. Pure. Source: W.
/// Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065, 2008, section 5.2.4.
[[nodiscard]] std::vector<AllanPoint> overlapping_allan(std::span<const double> signal,
                                                        double period_s,
                                                        std::span<const std::size_t> factors);

/// Factors from 1 to at most `largest`, about `per_octave` of them to each doubling.
[[nodiscard]] std::vector<std::size_t> allan_factors(std::size_t largest, int per_octave);

}  // namespace geoflow::calibration
