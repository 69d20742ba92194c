#pragma once

#include <algorithm>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// Lets through `rate_hz` things a second on average and at most `burst` at once.
/// Thread-compatible.
class TokenBucket {
 public:
  TokenBucket(double rate_hz, double burst, HostTime now)
      : rate_hz_{rate_hz}, burst_{burst}, tokens_{burst}, last_{now} {}

  /// Takes one token; false when there is none.
  [[nodiscard]] bool take(HostTime now) noexcept {
    tokens_ = std::min(burst_, tokens_ + to_seconds(now - last_) * rate_hz_);
    last_ = now;
    if (tokens_ < 1.0) {
      return false;
    }
    tokens_ -= 1.0;
    return true;
  }

 private:
  double rate_hz_;
  double burst_;
  double tokens_;
  HostTime last_;
};

/// Thins a stream to `rate_hz` (0 or not a number: not at all; at least one item a day), keeping
/// its phase; an item may be a quarter of a period early, so that jitter does not turn half the
/// rate into a third. Thread-compatible.
class RateLimit {
 public:
  explicit RateLimit(double rate_hz)
      : period_{rate_hz > 0.0 ? from_seconds(std::min(1.0 / rate_hz, kLongestPeriodS))
                              : Duration::zero()} {}

  /// Whether the item at `now` is due.
  [[nodiscard]] bool due(HostTime now) noexcept {
    if (now < next_ - period_ / 4) {
      return false;
    }
    next_ = next_ + period_ > now ? next_ + period_ : now + period_;
    return true;
  }

 private:
  static constexpr double kLongestPeriodS = 86'400;  ///< any client may ask for any rate

  Duration period_;
  HostTime next_{};
};

}  // namespace geoflow::daemon
