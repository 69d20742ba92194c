#pragma once

#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "src/ray_scene.hpp"
#include "src/shader.hpp"

namespace geoflow::simulator {

/// What the left infrared camera sees at one moment; row by row.
struct InfraredView {
  std::vector<float> depth_m;  ///< along the optical axis; 0: sky
  /// How well stereo can match there: contrast that the projected pattern and the surface's own
  /// texture give, about 1 on a light wall at 1 m.
  std::vector<float> signal;
};

/// Renders it at a time [s] of the people's walk. `projector_power` is the pattern's, times a
/// D435i's.
[[nodiscard]] InfraredView see_infrared(const RayScene& rays, const Shader& shader,
                                        const CameraIntrinsics& intrinsics, const SE3& T_world_ir,
                                        double t_s, float projector_power);

}  // namespace geoflow::simulator
