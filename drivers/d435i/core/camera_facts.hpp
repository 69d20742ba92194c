#pragma once

#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/monitor/versions.hpp"
#include "d435i/pixels/registration.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::d435i {

/// What a camera says of itself.
struct CameraFacts {
  Versions versions;
  RegistrationGeometry geometry;  ///< at the sizes asked for
  double baseline_m = 0;          ///< of the two depth imagers
  ImuTable imu;                   ///< the factory's where it has one; else as drawn
};

/// What a camera has in store of itself, for all of its sizes.
struct CameraTables {
  Versions versions;
  DepthTable depth;
  ColorTable color;
  /// Of depth, the firmware's own list by resolution; empty where it has none.
  std::vector<CameraIntrinsics> resolutions{};
  double depth_unit_m = kDefaultDepthUnit_m;
  ImuTable imu{};
};

/// Asks for versions, calibration tables and depth unit. A camera without IMU calibration is usual.
/// Errors name the table or the command.
[[nodiscard]] Result<CameraTables> read_tables(Transport& transport);

/// What the tables say of two sizes. Intrinsics of depth come from the firmware's list where that
/// has the size, else from the table. kNotFound where neither has anything to go by. Pure.
[[nodiscard]] Result<CameraFacts> facts_of(const CameraTables& tables, const VideoMode& depth,
                                           const VideoMode& color);

/// Both in one.
[[nodiscard]] Result<CameraFacts> read_facts(Transport& transport, const VideoMode& depth,
                                             const VideoMode& color);

/// The calibration of the ports: colour intrinsics, depth registered exactly, where the IMU is.
[[nodiscard]] Calibration calibration_of(const CameraFacts& facts);

}  // namespace geoflow::drivers::d435i
