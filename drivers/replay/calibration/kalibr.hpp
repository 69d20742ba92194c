#pragma once

#include <string>
#include <string_view>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

/// The parsers behind calibration_file.hpp, on text. Errors name `file`, line and key. Pure.
namespace geoflow::drivers::kalibr {

/// A camera chain. Without T_cam_imu, T_base_cam or depth_factor: none, none, 1000 counts per
/// metre.
[[nodiscard]] Result<Calibration> parse_camchain(std::string_view file, std::string content);

/// An imu.yaml; keys that are missing keep the defaults of ImuNoise.
[[nodiscard]] Result<ImuNoise> parse_imu(std::string_view file, std::string content);

}  // namespace geoflow::drivers::kalibr
