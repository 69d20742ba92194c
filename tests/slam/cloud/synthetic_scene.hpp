#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"

/// Depth images of simple scenes, computed from their equations.
namespace geoflow::tests {

/// A rectangle in the world [m]: an infinite plane `normal . x = offset`, cut to the box [low,
/// high].
struct Face {
  Vector3d normal;
  double offset = 0;
  Vector3d low = Vector3d::Constant(-1e3);
  Vector3d high = Vector3d::Constant(1e3);
};

using Scene = std::vector<Face>;

/// Worlds in front of a camera at the origin that looks along z (x right, y down).
[[nodiscard]] Scene wall();           ///< one plane across the view at 2 m
[[nodiscard]] Scene corridor();       ///< floor, ceiling and two side walls along z; no end
[[nodiscard]] Scene room_corner();    ///< floor and two walls
[[nodiscard]] Scene wall_with_box();  ///< a wall at 2.5 m and a box in front of it
[[nodiscard]] Scene room();           ///< corner, box on the floor and a slanted board

/// How a depth camera errs.
struct DepthNoise {
  double inverse_depth_sigma = 0;  ///< [1/m], white over pixels before blurring
  int blur_px = 1;  ///< side of the square over which noise is averaged (matching window)
  double hole_probability = 0;  ///< of a pixel without depth
  std::uint64_t seed = 1;
};

/// The depth image [counts of depth_unit_m] of a scene by a camera at T_world_cam.
[[nodiscard]] FrameRef render(const Scene& scene, const SE3& T_world_cam,
                              const CameraIntrinsics& camera, double depth_unit_m,
                              const DepthNoise& noise = {});

/// A 640 x 480 camera like a Kinect's or D435's colour camera, without distortion.
[[nodiscard]] CameraIntrinsics vga_camera();

}  // namespace geoflow::tests
