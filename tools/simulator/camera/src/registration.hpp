#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::simulator {

/// Two cameras and where one is seen from the other.
struct Registration {
  CameraIntrinsics depth;
  CameraIntrinsics color;
  SE3 T_cam_ir;
};

/// Depth of the infrared camera [m] as depth of the colour camera in whole millimetres, as the
/// device's software aligns it: each depth pixel becomes the rectangle between its projected
/// corners, the nearest one stays. 0: none, or beyond 65 m.
void align_to_color(const std::vector<float>& depth_m, const Registration& registration,
                    std::span<std::uint16_t> out_mm);

}  // namespace geoflow::simulator
