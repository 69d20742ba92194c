#pragma once

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// A frame's estimate carried on to an IMU sample (slam/propagator.hpp).
struct PropagatedPose {
  PoseEstimate estimate;
  HostTime t_frame{};      ///< of the frame
  HostTime t_arrival{};    ///< of the sample
  Duration error_bound{};  ///< of the sample's time
};

}  // namespace geoflow::daemon
