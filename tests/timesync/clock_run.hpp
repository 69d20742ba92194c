#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_model.hpp"

#include "random_clock.hpp"

/// Runs a clock model over a random clock and judges it against the truth.
namespace geoflow::timesync::tests {

using Model = ClockModel<CameraClock>;

inline constexpr std::int64_t kHostStartNs = 5'000'000'000'000;
inline constexpr double kSecondNs = 1e9;
inline constexpr StampInfo kDevice{.domain = StampDomain::kDevice};
inline constexpr StampInfo kWrapping{.domain = StampDomain::kDevice, .wrap = Duration{kWrap32Us}};

inline DeviceTime<CameraClock> device(std::int64_t ns) {
  return DeviceTime<CameraClock>{Duration{ns}};
}
inline HostTime host(std::int64_t ns) {
  return HostTime{Duration{ns}};
}
inline std::int64_t count(HostTime t) {
  return t.time_since_epoch().count();
}

/// One sample of a run: how wrong the model was, and how wrong it said that it might be [ns].
struct Judged {
  double error_ns = 0;
  double bound_ns = 0;
};

/// Feeds `duration_s` of samples and judges each against the truth.
inline std::vector<Judged> run(Model& model, const RandomClock& clock, const Jitter& jitter,
                               double duration_s, Random& random) {
  std::vector<Judged> judged;
  for (double t_ns = 0; t_ns < duration_s * kSecondNs; t_ns += clock.period_ns) {
    const auto truth = kHostStartNs + static_cast<std::int64_t>(t_ns);
    const auto delay = static_cast<std::int64_t>(jitter.draw_ns(random));
    const HostStamp stamp = model.add(device(clock.stamp_ns(t_ns)), host(truth + delay)).stamp;
    judged.push_back({static_cast<double>(count(stamp.t) - truth),
                      static_cast<double>(stamp.error_bound.count())});
  }
  return judged;
}

struct Statistics {
  double mean_abs_ns = 0;
  double worst_ns = 0;
  double mean_bound_ns = 0;
  double covered = 0;
};

inline Statistics statistics(const std::vector<Judged>& judged, std::size_t skip) {
  Statistics sum;
  const auto size = static_cast<double>(judged.size() - skip);
  for (std::size_t i = skip; i < judged.size(); ++i) {
    const double error = std::abs(judged[i].error_ns);
    sum.mean_abs_ns += error / size;
    sum.worst_ns = std::max(sum.worst_ns, error);
    sum.mean_bound_ns += judged[i].bound_ns / size;
    sum.covered += (error <= judged[i].bound_ns ? 1.0 : 0.0) / size;
  }
  return sum;
}

}  // namespace geoflow::timesync::tests
