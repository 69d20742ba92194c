#pragma once

#include <string>

#include "geoflow/hal/calibration.hpp"

/// The counterpart of the parsers in kalibr.hpp. Pure.
namespace geoflow::drivers::kalibr {

[[nodiscard]] std::string write_camchain(const Calibration& calibration);
[[nodiscard]] std::string write_imu(const ImuNoise& noise);

}  // namespace geoflow::drivers::kalibr
