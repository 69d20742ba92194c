#pragma once

#include <optional>
#include <utility>

#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/propagator.hpp"
#include "geoflow/timesync/synchroniser.hpp"

namespace geoflow::daemon {

/// Hands samples to the synchroniser, and as it places them on to the propagator. Where nobody
/// listens, or there is no propagator, it does the former only. Thread-bound: the synchroniser's.
class Propagation {
 public:
  Propagation(slam::Propagator* propagator, PropagatedHandler handler)
      : propagator_{handler ? propagator : nullptr}, handler_{std::move(handler)} {}

  void push(timesync::Synchroniser& synchroniser, const Arrival<ImuClock, ImuSample>& sample) {
    const std::optional<Timed<ImuSample>> placed = synchroniser.push_imu(sample);
    if (placed && propagator_ != nullptr) {
      if (const std::optional<PoseEstimate> estimate = propagator_->add(*placed)) {
        handler_({.estimate = *estimate,
                  .t_frame = propagator_->frame_time(),
                  .t_arrival = sample.t_arrival,
                  .error_bound = placed->error_bound});
      }
    }
  }
  void push(timesync::Synchroniser& synchroniser, const Arrival<LegClock, LegSample>& sample) {
    hand_on(synchroniser.push_legs(sample));
  }
  void push(timesync::Synchroniser& synchroniser,
            const Arrival<LegClock, BodyVelocitySample>& sample) {
    hand_on(synchroniser.push_body_velocity(sample));
  }

  /// A frame's estimate, whenever it comes.
  void correct(const PoseEstimate& frame) {
    if (propagator_ != nullptr) {
      propagator_->correct(frame);
    }
  }

 private:
  template <typename Sample>
  void hand_on(const std::optional<Timed<Sample>>& placed) {
    if (placed && propagator_ != nullptr) {
      propagator_->add(*placed);
    }
  }

  slam::Propagator* propagator_;
  PropagatedHandler handler_;
};

}  // namespace geoflow::daemon
