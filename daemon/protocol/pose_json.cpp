#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/pose_estimate.hpp"

namespace geoflow::daemon {
namespace {

nlohmann::json array(std::span<const double> values) {
  // NOLINTNEXTLINE(modernize-return-braced-init-list): braces would make it an array of one array
  return nlohmann::json(values);
}

nlohmann::json sensors(std::uint32_t bits) {
  nlohmann::json names = nlohmann::json::array();
  constexpr std::array<std::pair<std::uint32_t, const char*>, 5> kNames = {
      {{GEOFLOW_SENSOR_COLOR, "color"},
       {GEOFLOW_SENSOR_DEPTH, "depth"},
       {GEOFLOW_SENSOR_IMU, "imu"},
       {GEOFLOW_SENSOR_LEGS, "legs"},
       {GEOFLOW_SENSOR_BODY_VELOCITY, "body_velocity"}}};
  for (const auto& [bit, name] : kNames) {
    if ((bits & bit) != 0) {
      names.emplace_back(name);
    }
  }
  return names;
}

std::string source_name(std::uint8_t source) {
  const auto last = static_cast<std::uint8_t>(PoseSource::kConstantVelocity);
  return source <= last ? to_string(static_cast<PoseSource>(source)) : std::to_string(source);
}

}  // namespace

std::string status_name(std::uint8_t status) {
  return status <= GEOFLOW_LOST ? to_string(static_cast<TrackingStatus>(status))
                                : std::to_string(status);
}

nlohmann::json pose_to_json(const geoflow_pose& pose) {
  return {{"t_capture_ns", pose.t_capture_ns},
          {"t_arrival_ns", pose.t_arrival_ns},
          {"t_publish_ns", pose.t_publish_ns},
          {"t_recording_ns", pose.t_recording_ns},
          {"realtime_minus_mono_ns", pose.realtime_minus_mono_ns},
          {"sync_error_bound_ns", pose.sync_error_bound_ns},
          {"frame", pose.frame},
          {"p_odom_base", array(pose.p_odom_base)},
          {"q_odom_base", array(pose.q_odom_base)},
          {"p_map_odom", array(pose.p_map_odom)},
          {"q_map_odom", array(pose.q_map_odom)},
          {"v_base", array(pose.v_base)},
          {"w_base", array(pose.w_base)},
          {"covariance", array(pose.covariance)},
          {"status", status_name(pose.status)},
          {"source", source_name(pose.source)},
          {"quality", pose.quality},
          {"replay", (pose.clock_flags & GEOFLOW_CLOCK_REPLAY) != 0},
          {"unpaced", (pose.clock_flags & GEOFLOW_CLOCK_UNPACED) != 0},
          {"reset_counter", pose.reset_counter},
          {"map_id", pose.map_id},
          {"visual_inliers", pose.visual_inliers},
          {"depth_inliers", pose.depth_inliers},
          {"sensors", sensors(pose.sensors)},
          {"frames_dropped", pose.frames_dropped},
          {"t_frame_ns", pose.t_frame_ns},
          {"propagated", is_propagated(pose)}};
}

}  // namespace geoflow::daemon
