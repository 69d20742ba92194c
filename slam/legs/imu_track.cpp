#include "legs/imu_track.hpp"

#include <algorithm>
#include <iterator>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {

void ImuTrack::add(const Timed<ImuSample>& sample) {
  const bool finite = sample.sample.accel_mps2.allFinite() && sample.sample.gyro_radps.allFinite();
  if (finite && (samples_.empty() || sample.t > samples_.back().t)) {
    samples_.push_back(sample);
  }
}

void ImuTrack::forget_before(HostTime t) {
  while (samples_.size() > 1 && samples_[1].t <= t) {
    samples_.pop_front();
  }
}

ImuSample ImuTrack::at(HostTime t) const {
  const auto after = std::ranges::lower_bound(samples_, t, {}, &Timed<ImuSample>::t);
  if (after == samples_.begin()) {
    return samples_.front().sample;
  }
  if (after == samples_.end()) {
    return samples_.back().sample;
  }
  const auto before = std::prev(after);
  const double ratio = to_seconds(t - before->t) / to_seconds(after->t - before->t);
  const auto mixed = [&](const Vector3d& a, const Vector3d& b) {
    return Vector3d{a + ratio * (b - a)};
  };
  return {.accel_mps2 = mixed(before->sample.accel_mps2, after->sample.accel_mps2),
          .gyro_radps = mixed(before->sample.gyro_radps, after->sample.gyro_radps)};
}

HostTime ImuTrack::next_knot(HostTime from, HostTime to) const {
  const auto after = std::ranges::upper_bound(samples_, from, {}, &Timed<ImuSample>::t);
  return after == samples_.end() ? to : std::min(after->t, to);
}

}  // namespace geoflow::slam
