#pragma once

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

/// Reads versions, calibration tables and depth unit. Intrinsics of depth come from the firmware's
/// list by resolution where it has one, else from the table. A camera without IMU calibration is
/// usual. Errors name the table or the command.
[[nodiscard]] Result<CameraFacts> read_facts(Transport& transport, const VideoMode& depth,
                                             const VideoMode& color);

/// The calibration of the ports: colour intrinsics, depth registered exactly, where the IMU is.
[[nodiscard]] Calibration calibration_of(const CameraFacts& facts);

}  // namespace geoflow::drivers::d435i
