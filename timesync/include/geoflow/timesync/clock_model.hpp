#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_fit.hpp"
#include "geoflow/timesync/wrap.hpp"

namespace geoflow::timesync {

/// An instant on the host's time line and how far the truth may be from it.
struct HostStamp {
  HostTime t;
  Duration error_bound{};
};

/// The bridge, and the only one, from a device's clock to the host's. Thread-bound; time is an
/// argument.
///
/// StampDomain::kHost: the identity, exact, bound zero. StampDomain::kDevice: unwraps the counter
/// (StampInfo::wrap) and fits it to the arrivals (clock_fit.hpp has the method). Streams stamped by
/// one clock share one model.
template <typename Clock>
class ClockModel {
 public:
  explicit ClockModel(const StampInfo& stamps, const ClockFitConfig& config = {}) noexcept
      : stamps_{stamps}, fit_{config} {}

  /// A placed sample, with what StreamOrder needs.
  struct Sample {
    HostStamp stamp;
    std::int64_t device_ns = 0;  ///< unwrapped
    std::uint64_t epoch = 0;  ///< counts the clock's jumps: device counts compare only within one
    bool by_arrival = false;  ///< the device's stamp could not be believed
  };

  /// Learns from one sample and places it. A stamp or arrival outside kMinStampNs…kMaxStampNs is
  /// not learnt from; it is placed at its arrival with the largest bound.
  Sample add(DeviceTime<Clock> t_device, HostTime t_arrival) noexcept {
    const std::int64_t raw_ns = t_device.time_since_epoch().count();
    const std::int64_t arrival_ns = t_arrival.time_since_epoch().count();
    if (stamps_.domain == StampDomain::kHost) {
      return {.stamp = {HostTime{Duration{raw_ns}}, Duration::zero()}, .device_ns = raw_ns};
    }
    if (!is_plausible_stamp_ns(raw_ns) || !is_plausible_stamp_ns(arrival_ns)) {
      return {.stamp = {t_arrival, Duration::max()}, .by_arrival = true};
    }
    const std::int64_t device_ns = unwrapped(raw_ns, fit_.expect_device_ns(arrival_ns));
    const Placed placed = fit_.add(device_ns, arrival_ns);
    return {.stamp = {HostTime{Duration{placed.t_ns}}, Duration{placed.error_bound_ns}},
            .device_ns = device_ns,
            .epoch = fit_.counters().jumps,
            .by_arrival = placed.by_arrival};
  }

  /// Places a stamp without learning from it; a wrapping one within half a period of the newest.
  /// Before the first add() of a kDevice clock, and for an implausible stamp, the bound is the
  /// largest Duration and t says nothing.
  [[nodiscard]] HostStamp to_host(DeviceTime<Clock> t_device) const noexcept {
    const std::int64_t raw_ns = t_device.time_since_epoch().count();
    if (stamps_.domain == StampDomain::kHost) {
      return {.t = HostTime{Duration{raw_ns}}, .error_bound = Duration::zero()};
    }
    if (!is_plausible_stamp_ns(raw_ns)) {
      return {.t = HostTime{}, .error_bound = Duration::max()};
    }
    const Placed placed = fit_.place(unwrapped(raw_ns, fit_.newest_device_ns()));
    return {.t = HostTime{Duration{placed.t_ns}}, .error_bound = Duration{placed.error_bound_ns}};
  }

  /// True for StampDomain::kHost: stamps are taken as they are.
  [[nodiscard]] bool is_identity() const noexcept { return stamps_.domain == StampDomain::kHost; }
  /// True once a stamp can be placed.
  [[nodiscard]] bool locked() const noexcept {
    return stamps_.domain == StampDomain::kHost || fit_.locked();
  }
  [[nodiscard]] const ClockFit& fit() const noexcept { return fit_; }
  [[nodiscard]] const ClockCounters& counters() const noexcept { return fit_.counters(); }

 private:
  [[nodiscard]] std::int64_t unwrapped(std::int64_t raw_ns,
                                       std::int64_t expected_ns) const noexcept {
    if (!stamps_.wrap || *stamps_.wrap <= Duration::zero() || !fit_.locked()) {
      return raw_ns;
    }
    const std::int64_t device_ns = unwrap_ns(raw_ns, stamps_.wrap->count(), expected_ns);
    return is_plausible_stamp_ns(device_ns) ? device_ns : raw_ns;
  }

  StampInfo stamps_;
  ClockFit fit_;
};

/// Keeps the placed stamps of one stream in the order of its device's counts, though the clock's
/// line moves between them: a later count gets a later time, an earlier one an earlier, an equal
/// one the same. Each correction is added to the bound. After a jump of the clock, time goes on
/// from where it was. Thread-bound, O(1).
class StreamOrder {
 public:
  /// `Sample`: ClockModel::Sample of this stream, in order of arrival. Identity for kHost stamps
  /// (not to be called).
  template <typename Sample>
  [[nodiscard]] HostStamp keep(const Sample& sample) noexcept {
    HostStamp stamp = sample.stamp;
    const bool comparable = last_ && !sample.by_arrival && sample.epoch == epoch_;
    if (comparable && sample.device_ns == device_ns_) {
      stamp.t = *last_;
    } else if (comparable && sample.device_ns < device_ns_) {
      stamp.t = std::min(stamp.t, *last_ - Duration{1});
      return widen(stamp, sample.stamp);  // out of order: what came last stays the measure
    } else if (last_) {
      stamp.t = std::max(stamp.t, *last_ + Duration{1});
    }
    last_ = stamp.t;
    if (!sample.by_arrival) {
      device_ns_ = sample.device_ns;
      epoch_ = sample.epoch;
    }
    return widen(stamp, sample.stamp);
  }

 private:
  [[nodiscard]] static HostStamp widen(HostStamp kept, const HostStamp& placed) noexcept {
    const Duration moved = kept.t > placed.t ? kept.t - placed.t : placed.t - kept.t;
    kept.error_bound =
        placed.error_bound > Duration::max() - moved ? Duration::max() : placed.error_bound + moved;
    return kept;
  }

  std::optional<HostTime> last_;
  std::int64_t device_ns_ = 0;
  std::uint64_t epoch_ = 0;
};

}  // namespace geoflow::timesync
