#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::openloris {

/// Whether `directory` has color.txt and aligned_depth.txt.
[[nodiscard]] bool looks_like(const std::filesystem::path& directory);

/// A package of OpenLORIS-Scene: the D400's colour, depth aligned to it, and, where
/// d400_accelerometer.txt and d400_gyroscope.txt are there, its IMU (without the factory's
/// imu_intrinsic: raw, as a device gives it). Calibration from sensors.yaml and trans_matrix.yaml
/// where they are there.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& directory);

}  // namespace geoflow::drivers::openloris
