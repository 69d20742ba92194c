#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>

/// A device clock and a transport with known truth, for the clock model's tests.
namespace geoflow::timesync::tests {

using Random = std::mt19937_64;

/// A distribution of delays above the transport's least [ns], of unit `scale_ns`.
struct Jitter {
  std::string name;
  std::function<double(Random&)> draw_ns;
  double scale_ns = 0;
};

inline constexpr double kMsInNs = 1e6;

inline Jitter exponential_jitter(double scale_ns) {
  return {
      "exponential",
      [scale_ns](Random& random) { return std::exponential_distribution{1.0 / scale_ns}(random); },
      scale_ns};
}
inline Jitter uniform_jitter(double scale_ns) {
  return {"uniform",
          [scale_ns](Random& random) {
            return std::uniform_real_distribution{0.0, 2 * scale_ns}(random);
          },
          scale_ns};
}
inline Jitter half_normal_jitter(double scale_ns) {
  return {"half normal",
          [scale_ns](Random& random) {
            return std::abs(std::normal_distribution{0.0, scale_ns}(random));
          },
          scale_ns};
}
/// Few samples near the least: the hard case for an envelope.
inline Jitter gamma_jitter(double scale_ns) {
  return {"gamma 2",
          [scale_ns](Random& random) { return std::gamma_distribution{2.0, scale_ns / 2}(random); },
          scale_ns};
}
inline constexpr double kHeavyShape = 1.5;
inline constexpr double kLongestDelayNs = 1e9;

/// Pareto (Lomax) of shape 1.5, whose variance is infinite, as far as a transport's queue holds: 1
/// s.
inline Jitter heavy_jitter(double scale_ns) {
  return {"heavy tail",
          [scale_ns](Random& random) {
            const double u = std::uniform_real_distribution{0.0, 1.0}(random);
            return std::min(scale_ns / 2 * (std::pow(1.0 - u, -1.0 / kHeavyShape) - 1.0),
                            kLongestDelayNs);
          },
          scale_ns};
}
/// Mostly quick, now and then a queue of twenty times the scale.
inline Jitter queueing_jitter(double scale_ns) {
  return {"queueing",
          [scale_ns](Random& random) {
            const bool queued = std::bernoulli_distribution{0.1}(random);
            return std::exponential_distribution{1.0 / scale_ns}(random) +
                   (queued ? 20 * scale_ns : 0.0);
          },
          scale_ns};
}

/// device(t) = offset + t / (1 + drift), stamped in whole microseconds, optionally modulo
/// `wrap_ns`.
struct RandomClock {
  std::int64_t offset_ns = 0;
  double drift = 0;  ///< host seconds per device second, minus 1
  std::int64_t wrap_ns = 0;
  double period_ns = 0;

  [[nodiscard]] std::int64_t stamp_ns(double t_ns) const {
    constexpr std::int64_t kMicrosecond = 1000;
    std::int64_t count = offset_ns + static_cast<std::int64_t>(t_ns / (1.0 + drift));
    count -= count % kMicrosecond;
    return wrap_ns > 0 ? ((count % wrap_ns) + wrap_ns) % wrap_ns : count;
  }
};

inline constexpr std::int64_t kWrap32Us = (std::int64_t{1} << 32) * 1000;

/// Offset over the whole wrap, drift within +-200 ppm, 30 to 500 Hz.
inline RandomClock draw_clock(Random& random, bool wraps) {
  RandomClock clock;
  clock.offset_ns = std::uniform_int_distribution<std::int64_t>{0, kWrap32Us}(random);
  clock.drift = std::uniform_real_distribution{-200e-6, 200e-6}(random);
  clock.wrap_ns = wraps ? kWrap32Us : 0;
  constexpr double kSecond = 1e9;
  clock.period_ns = kSecond / std::uniform_real_distribution{30.0, 500.0}(random);
  return clock;
}

}  // namespace geoflow::timesync::tests
