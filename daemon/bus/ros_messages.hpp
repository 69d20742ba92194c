#pragma once

#include <optional>
#include <string>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/drivers/ros_publisher.hpp"

#include "service/status_line.hpp"

/// What the bus says, from what the sockets say. Pure.
namespace geoflow::daemon::bus {

/// A pose for ROS 2; none where the status says that there is no pose (STARTING, INITIALISING,
/// LOST). Its time is CLOCK_REALTIME's at the capture; of a replay that is not paced, the
/// recording's. The pose's covariance is the record's; the estimator gives none for the twist,
/// whose is diagonal and of the configured standard deviations.
[[nodiscard]] std::optional<drivers::RosPose> make_ros_pose(const geoflow_pose& pose,
                                                            const RosConfig& config);

/// The daemon's health, one entry for the pose and one for each source. `summary`: the status line.
[[nodiscard]] std::vector<drivers::RosDiagnostic> make_diagnostics(const service::Observation& seen,
                                                                   const std::string& summary);

}  // namespace geoflow::daemon::bus
