#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/geometry.hpp"

/// Poses as they are shown. Pure; thread-safe.
namespace geoflow::tools {

/// T_map_base of the record's two transforms.
[[nodiscard]] SE3 map_from_base(const geoflow_pose& pose);

/// One line for people: time of the recording, status, place in the map, how sure, how late.
[[nodiscard]] std::string pose_line(const daemon::ReceivedPose& received);

/// One object for programs: the record's keys, `dropped` and `t_received_ns` (docs/cli.md).
[[nodiscard]] nlohmann::json pose_object(const daemon::ReceivedPose& received);

}  // namespace geoflow::tools
