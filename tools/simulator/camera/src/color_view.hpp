#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/ray_scene.hpp"
#include "src/shader.hpp"

namespace geoflow::simulator {

/// When each row of a rolling shutter is open.
struct Shutter {
  double t_mid_s = 0;  ///< the middle of the middle row's exposure
  double exposure_s = 0;
  double readout_s = 0;
  int rows = 0;

  [[nodiscard]] double row_mid_s(int row) const noexcept {
    return t_mid_s +
           readout_s * ((static_cast<double>(row) + 0.5) / static_cast<double>(rows) - 0.5);
  }
  [[nodiscard]] double begin_s() const noexcept { return t_mid_s - 0.5 * (exposure_s + readout_s); }
  [[nodiscard]] double end_s() const noexcept { return t_mid_s + 0.5 * (exposure_s + readout_s); }
};

/// What rays are sent through and how many.
struct Sampling {
  int rays_a_pixel = 1;
  std::uint64_t key = 0;  ///< decides how they spread over a pixel and its exposure
};

/// Mean luminance [cd/m^2] of each pixel over its exposure, row by row: rays spread over time and
/// over the pixel. The people must have been moved to the shutter's begin and end.
[[nodiscard]] std::vector<Rgb> expose(const RayScene& rays, const Shader& shader,
                                      const CameraIntrinsics& intrinsics, const Shutter& shutter,
                                      const PoseAt& T_world_cam, const Sampling& sampling);

/// Depth along the optical axis at the pixels' centres [m], 0 for the sky.
[[nodiscard]] std::vector<float> true_depth(const RayScene& rays,
                                            const CameraIntrinsics& intrinsics,
                                            const SE3& T_world_cam, float ray_time);

/// The luminance that automatic exposure meters in a view: the squared mean of the root of a coarse
/// grid's, so that few bright lamps do not make all else dark.
[[nodiscard]] float metered_luminance(const RayScene& rays, const Shader& shader,
                                      const CameraIntrinsics& intrinsics, const SE3& T_world_cam);

}  // namespace geoflow::simulator
