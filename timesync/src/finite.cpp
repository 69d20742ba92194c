#include "geoflow/timesync/finite.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "geoflow/hal/samples.hpp"

namespace geoflow::timesync {
namespace {

bool is_finite(const JointState& joint) {
  return std::isfinite(joint.q_rad) && std::isfinite(joint.dq_radps) && std::isfinite(joint.tau_nm);
}

}  // namespace

bool is_usable(const ImuSample& sample) {
  return sample.accel_mps2.allFinite() && sample.gyro_radps.allFinite();
}

bool is_usable(const LegSample& sample) {
  for (std::size_t joint = 0; joint < sample.joints.size(); ++joint) {
    if (sample.valid[joint / kJointsPerLeg] && !is_finite(sample.joints[joint])) {
      return false;
    }
  }
  return std::ranges::all_of(sample.foot_force, [](float force) { return std::isfinite(force); });
}

bool is_usable(const BodyVelocitySample& sample) {
  return sample.v_base_mps.allFinite() && sample.w_base_radps.allFinite();
}

bool is_usable(const ColorFrame& frame) {
  return static_cast<bool>(frame.image);
}

bool is_usable(const DepthFrame& frame) {
  return static_cast<bool>(frame.image);
}

}  // namespace geoflow::timesync
