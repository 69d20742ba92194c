#pragma once

#include <filesystem>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

/// Calibrations in Kalibr's files, with this project's extensions.
///
/// `camchain-imucam.yaml` or `camchain.yaml`: `cam0` with camera_model (pinhole), intrinsics,
/// distortion_model (radtan, equidistant or none), distortion_coeffs, resolution, T_cam_imu (4 x 4,
/// row by row), timeshift_cam_imu [s]. Further cameras are not read. Extensions at the top level:
/// T_base_cam (4 x 4), depth_factor (counts per metre), serial. `imu.yaml`:
/// accelerometer_noise_density, accelerometer_random_walk, gyroscope_noise_density,
/// gyroscope_random_walk, update_rate, at the top level or under `imu0`.
namespace geoflow::drivers {

/// Whether `directory` has a camera chain that load_calibration() would read.
[[nodiscard]] bool has_calibration(const std::filesystem::path& directory);

/// Reads `directory`'s camera chain and, if there is one, its imu.yaml. Errors name file, line and
/// key. Thread-safe.
[[nodiscard]] Result<Calibration> load_calibration(const std::filesystem::path& directory);

/// Writes camchain-imucam.yaml and imu.yaml into `directory`, which must exist. Each file is
/// replaced as a whole or not at all. load_calibration() reads back the same numbers, bit for bit
/// in all but rotations, which are normalised; a camera with nothing but zero coefficients comes
/// back as kNone.
[[nodiscard]] Result<void> save_calibration(const Calibration& calibration,
                                            const std::filesystem::path& directory);

}  // namespace geoflow::drivers
