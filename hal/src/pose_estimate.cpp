#include "geoflow/hal/pose_estimate.hpp"

namespace geoflow {

const char* to_string(TrackingStatus status) noexcept {
  switch (status) {
    case TrackingStatus::kStarting:
      return "STARTING";
    case TrackingStatus::kInitialising:
      return "INITIALISING";
    case TrackingStatus::kTracking:
      return "TRACKING";
    case TrackingStatus::kDegraded:
      return "DEGRADED";
    case TrackingStatus::kRelocalising:
      return "RELOCALISING";
    case TrackingStatus::kLost:
      return "LOST";
  }
  return "?";
}

const char* to_string(PoseSource source) noexcept {
  switch (source) {
    case PoseSource::kNone:
      return "none";
    case PoseSource::kImu:
      return "imu";
    case PoseSource::kLegs:
      return "legs";
    case PoseSource::kPnp:
      return "pnp";
    case PoseSource::kGicp:
      return "gicp";
    case PoseSource::kConstantVelocity:
      return "constant_velocity";
  }
  return "?";
}

}  // namespace geoflow
