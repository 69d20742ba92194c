#pragma once

#include <filesystem>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// Completes a camera's own calibration by what the Kalibr files in `directory` say of the robot:
/// where the camera and its IMU sit, and the IMU's noise. `with_intrinsics`: the camera's
/// intrinsics as well, since it does not know them well itself. Any thread.
///
/// Errors, which leave `calibration` as it is: as of load_calibration(); kInvalidArgument, naming
/// the file, where that is of a camera with another serial number, or of another size of image.
/// Where either does not say its serial number, nothing is compared.
[[nodiscard]] Result<void> complete_calibration(const std::filesystem::path& directory,
                                                bool with_intrinsics, Calibration& calibration);

}  // namespace geoflow::daemon
