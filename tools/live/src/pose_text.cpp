#include "geoflow/tools/pose_text.hpp"

#include <cmath>
#include <cstddef>
#include <string>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

using daemon::ReceivedPose;

constexpr double kMillisecondsPerNanosecond = 1e-6;
constexpr double kDegreesPerRadian = 57.29577951308232;

/// Standard deviation of the position: the root of the covariance's first three diagonal elements.
double position_sigma_m(const geoflow_pose& pose) {
  constexpr std::size_t kXx = 0;
  constexpr std::size_t kYy = 6;
  constexpr std::size_t kZz = 11;
  return std::sqrt(pose.covariance[kXx] + pose.covariance[kYy] + pose.covariance[kZz]);
}

}  // namespace

SE3 map_from_base(const geoflow_pose& pose) {
  const auto transform = [](const double* q, const double* p) {
    return SE3{Eigen::Quaterniond{q[3], q[0], q[1], q[2]}, Vector3d{p[0], p[1], p[2]}};
  };
  const SE3 T_map_odom = transform(&pose.q_map_odom[0], &pose.p_map_odom[0]);
  const SE3 T_odom_base = transform(&pose.q_odom_base[0], &pose.p_odom_base[0]);
  return T_map_odom * T_odom_base;
}

std::string pose_line(const ReceivedPose& received) {
  const geoflow_pose& pose = received.pose;
  const SE3 T_map_base = map_from_base(pose);
  const Vector3d& p = T_map_base.translation();
  const Matrix3d R = T_map_base.rotation_matrix();
  const double yaw_deg = std::atan2(R(1, 0), R(0, 0)) * kDegreesPerRadian;
  const auto status = static_cast<TrackingStatus>(pose.status);
  std::string line = fmt::format(
      "{:.3f} {:12} x {:8.3f} y {:8.3f} z {:8.3f} m  yaw {:7.2f} deg  sigma {:.3f} m  quality {:3}",
      to_seconds(Duration{pose.t_recording_ns}), to_string(status), p.x(), p.y(), p.z(), yaw_deg,
      position_sigma_m(pose), pose.quality);
  if ((pose.clock_flags & GEOFLOW_CLOCK_UNPACED) == 0) {
    const auto latency_ns =
        static_cast<double>(received.t_received.time_since_epoch().count() - pose.t_arrival_ns);
    line += fmt::format("  latency {:.1f} ms", latency_ns * kMillisecondsPerNanosecond);
  }
  if (received.dropped > 0) {
    line += fmt::format("  missed {}", received.dropped);
  }
  return line;
}

nlohmann::json pose_object(const ReceivedPose& received) {
  nlohmann::json line = daemon::pose_to_json(received.pose);
  line["dropped"] = received.dropped;
  line["t_received_ns"] = received.t_received.time_since_epoch().count();
  return line;
}

}  // namespace geoflow::tools
