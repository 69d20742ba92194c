#pragma once

#include <filesystem>

#include "geoflow/calibration/imu_noise.hpp"
#include "geoflow/hal/result.hpp"

#include "calibrate/outcome.hpp"

namespace geoflow::tools {

/// `geoflow calibrate imu-noise`: the noise of a recording's IMU. Errors name the recording.
[[nodiscard]] Result<Outcome> calibrate_imu_noise(const std::filesystem::path& recording,
                                                  const calibration::ImuNoiseOptions& options);

}  // namespace geoflow::tools
