#include "geoflow/calibration/allan.hpp"

#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

namespace geoflow::calibration {

std::vector<AllanPoint> overlapping_allan(std::span<const double> signal, double period_s,
                                          std::span<const std::size_t> factors) {
  const std::size_t count = signal.size();
  const double mean =
      std::accumulate(signal.begin(), signal.end(), 0.0) / static_cast<double>(count);
  // The mean drops out of every difference; without it, the sums stay small.
  std::vector<double> sums(count + 1);
  for (std::size_t i = 0; i < count; ++i) {
    sums[i + 1] = sums[i] + (signal[i] - mean);
  }
  std::vector<AllanPoint> points;
  for (const std::size_t factor : factors) {
    if (factor == 0 || 2 * factor > count) {
      continue;
    }
    const std::size_t terms = count - 2 * factor + 1;
    double squares = 0;
    for (std::size_t k = 0; k < terms; ++k) {
      const double difference = sums[k + 2 * factor] - 2 * sums[k + factor] + sums[k];
      squares += difference * difference;
    }
    const auto m = static_cast<double>(factor);
    const double variance = squares / (2 * m * m * static_cast<double>(terms));
    points.push_back({.tau_s = m * period_s,
                      .deviation = std::sqrt(variance),
                      .variance = variance,
                      .terms = terms});
  }
  return points;
}

std::vector<std::size_t> allan_factors(std::size_t largest, int per_octave) {
  std::vector<std::size_t> factors;
  for (int step = 0;; ++step) {
    const auto factor =
        static_cast<std::size_t>(std::llround(std::exp2(step / double(per_octave))));
    if (factor > largest) {
      return factors;
    }
    if (factors.empty() || factor > factors.back()) {
      factors.push_back(factor);
    }
  }
}

}  // namespace geoflow::calibration
