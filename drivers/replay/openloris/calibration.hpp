#pragma once

#include <string>
#include <string_view>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

/// OpenLORIS-Scene's sensors.yaml and trans_matrix.yaml (OpenCV's YAML). Source: the "package"
/// format of lifelong-robotic-vision.github.io/dataset/scene; the order of intrinsics as in its
/// openloris-scene-tools.
namespace geoflow::drivers::openloris {

/// The D400's colour camera: width, height, intrinsics (fx cx fy cy), radial-tangential
/// coefficients. Depth counts are millimetres. Errors name `file`, line and key.
[[nodiscard]] Result<FoundCalibration> parse_sensors(std::string_view file, std::string content);

/// Fills T_base_cam and T_cam_imu in from the chain of transforms between base_link, the colour
/// camera and the D400's accelerometer, where there is one.
[[nodiscard]] Result<void> parse_transforms(std::string_view file, std::string content,
                                            FoundCalibration& found);

}  // namespace geoflow::drivers::openloris
