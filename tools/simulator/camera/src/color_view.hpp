#pragma once

#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"
#include "src/sender.hpp"
#include "src/shader.hpp"
#include "src/steady_tiles.hpp"

namespace geoflow::simulator {

/// What a camera looks at.
struct Subject {
  const Scene& scene;
  const RayScene& rays;
  const Shader& shader;
};

/// Mean luminance [cd/m^2] of each pixel over its exposure, row by row: rays spread over time and
/// over the pixel. The people must have been moved over at least the shutter's begin to its end.
[[nodiscard]] std::vector<Rgb> expose(const Subject& subject, const CameraIntrinsics& intrinsics,
                                      const Shutter& shutter, const PoseAt& T_world_cam,
                                      const Sampling& sampling);

/// Depth along the optical axis at the pixels' centres [m], 0 for the sky.
[[nodiscard]] std::vector<float> true_depth(const RayScene& rays,
                                            const CameraIntrinsics& intrinsics,
                                            const SE3& T_world_cam, float ray_time);

/// The luminance that automatic exposure meters in a view at a time [s] of the people's walk: the
/// squared mean of the root of a coarse grid's, so that few bright lamps do not make all else dark.
[[nodiscard]] float metered_luminance(const Subject& subject, const CameraIntrinsics& intrinsics,
                                      const SE3& T_world_cam, double people_t_s);

}  // namespace geoflow::simulator
