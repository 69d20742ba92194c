#pragma once

#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow {

/// One pose of a trajectory in some fixed frame, at a time on the recording's (host's) time line.
struct StampedPose {
  HostTime t;
  SE3 pose;
};

/// Poses in order of time.
using Trajectory = std::vector<StampedPose>;

}  // namespace geoflow
