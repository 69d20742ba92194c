#pragma once

#include <filesystem>

#include "geoflow/calibration/imu_intrinsics.hpp"
#include "geoflow/hal/result.hpp"

#include "calibrate/outcome.hpp"

namespace geoflow::tools {

/// `geoflow calibrate imu`: scale, misalignment and biases of a recording's IMU. Errors name the
/// recording.
[[nodiscard]] Result<Outcome> calibrate_imu(const std::filesystem::path& recording,
                                            const calibration::ImuIntrinsicsOptions& options);

}  // namespace geoflow::tools
