#pragma once

#include <deque>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {

/// The newest IMU samples as a signal that is linear between them and constant beyond them.
/// Thread-compatible.
class ImuTrack {
 public:
  /// Takes a sample; one that is not newer than the last, or not finite, is ignored.
  void add(const Timed<ImuSample>& sample);

  /// Forgets what is older than the newest sample at or before `t`.
  void forget_before(HostTime t);

  [[nodiscard]] bool empty() const noexcept { return samples_.empty(); }
  /// Undefined on an empty track, as are the next two.
  [[nodiscard]] HostTime newest() const { return samples_.back().t; }
  [[nodiscard]] ImuSample at(HostTime t) const;
  /// The time in (from, to] of the first sample after `from`, or `to`.
  [[nodiscard]] HostTime next_knot(HostTime from, HostTime to) const;

 private:
  std::deque<Timed<ImuSample>> samples_;
};

}  // namespace geoflow::slam
