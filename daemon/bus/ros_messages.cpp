#include "bus/ros_messages.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

#include "service/status_line.hpp"

namespace geoflow::daemon::bus {
namespace {

using drivers::RosDiagnostic;
using Level = RosDiagnostic::Level;

bool has_pose(const geoflow_pose& pose) {
  return pose.status == GEOFLOW_TRACKING || pose.status == GEOFLOW_DEGRADED ||
         pose.status == GEOFLOW_RELOCALISING;
}

SE3 transform(const double* p, const double* q) {
  return SE3{Eigen::Quaterniond{q}, Vector3d{p}};  // both x, y, z, w
}

Matrix6d symmetric(const double* upper_triangle) {
  Matrix6d matrix;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index col = row; col < matrix.cols(); ++col) {
      matrix(row, col) = *upper_triangle;
      matrix(col, row) = *upper_triangle++;
    }
  }
  return matrix;
}

Matrix6d twist_covariance(const RosConfig& config) {
  Vector6d sigmas;
  sigmas << Vector3d::Constant(config.velocity_sigma_mps),
      Vector3d::Constant(config.angular_velocity_sigma_radps);
  return sigmas.cwiseAbs2().asDiagonal();
}

Level level_of(std::uint8_t status) {
  switch (status) {
    case GEOFLOW_TRACKING:
      return Level::kOk;
    case GEOFLOW_LOST:
      return Level::kError;
    default:
      return Level::kWarn;
  }
}

Level level_of(SourceState state) {
  switch (state) {
    case SourceState::kStreaming:
      return Level::kOk;
    case SourceState::kDegraded:
      return Level::kWarn;
    case SourceState::kFailed:
      return Level::kError;
    case SourceState::kStopped:
      break;
  }
  return Level::kStale;
}

RosDiagnostic pose_diagnostic(const service::Observation& seen, const std::string& summary) {
  RosDiagnostic diagnostic{.level = seen.pose ? level_of(seen.pose->status) : Level::kWarn,
                           .name = "geoflow: pose",
                           .message = summary,
                           .values = {{"frames", std::to_string(seen.frames)}}};
  if (seen.pose) {
    const geoflow_pose& pose = *seen.pose;
    diagnostic.values.insert(diagnostic.values.end(),
                             {{"status", status_name(pose.status)},
                              {"quality", std::to_string(pose.quality)},
                              {"visual_inliers", std::to_string(pose.visual_inliers)},
                              {"depth_inliers", std::to_string(pose.depth_inliers)},
                              {"reset_counter", std::to_string(pose.reset_counter)},
                              {"frames_dropped", std::to_string(pose.frames_dropped)}});
  }
  return diagnostic;
}

}  // namespace

std::optional<drivers::RosPose> make_ros_pose(const geoflow_pose& pose, const RosConfig& config) {
  if (!has_pose(pose)) {
    return std::nullopt;
  }
  const bool unpaced = (pose.clock_flags & GEOFLOW_CLOCK_UNPACED) != 0;
  return drivers::RosPose{.t = Duration{unpaced ? pose.t_recording_ns
                                                : pose.t_capture_ns + pose.realtime_minus_mono_ns},
                          .T_map_odom = transform(&pose.p_map_odom[0], &pose.q_map_odom[0]),
                          .T_odom_base = transform(&pose.p_odom_base[0], &pose.q_odom_base[0]),
                          .v_base = Vector3d{&pose.v_base[0]},
                          .w_base = Vector3d{&pose.w_base[0]},
                          .pose_covariance = symmetric(&pose.covariance[0]),
                          .twist_covariance = twist_covariance(config)};
}

std::vector<RosDiagnostic> make_diagnostics(const service::Observation& seen,
                                            const std::string& summary) {
  std::vector<RosDiagnostic> diagnostics{pose_diagnostic(seen, summary)};
  for (const auto& [name, health, since_sample, silent] : seen.sources) {
    diagnostics.push_back({.level = silent ? Level::kStale : level_of(health.state),
                           .name = "geoflow: " + name,
                           .message = !health.reason.empty() ? health.reason
                                      : silent               ? "silent"
                                                             : "ok",
                           .values = {{"delivered", std::to_string(health.delivered)},
                                      {"rejected", std::to_string(health.rejected)},
                                      {"dropped", std::to_string(health.dropped)}}});
  }
  return diagnostics;
}

}  // namespace geoflow::daemon::bus
