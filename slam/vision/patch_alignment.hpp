#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "vision/image_pyramid.hpp"

namespace geoflow::slam {

/// Side of the patch, less one, over two [px].
inline constexpr int kPatchRadiusPx = 5;

/// How the pixels around one of the current image lie in a reference image, both raw: where the
/// corners of the patch are there, which a surface's tilt and distance make another quadrangle.
struct PatchWarp {
  /// Homography from offsets to the patch's middle [px] to raw pixels of the reference.
  Matrix3d H_reference_offset = Matrix3d::Identity();
  double scale = 1;       ///< reference pixels per current pixel
  double anisotropy = 1;  ///< of the larger to the smaller stretch, at least 1
};

/// The warp that takes the corners (-r, -r), (r, -r), (r, r), (-r, r), r = kPatchRadiusPx, to the
/// columns of `corners` and the middle to itself. None where these do not make a convex
/// quadrangle. Pure.
[[nodiscard]] std::optional<PatchWarp> make_warp(const Eigen::Matrix<double, 2, 4>& corners);

/// Whether a patch was found, and where.
struct PatchSearch {
  enum class Result : std::uint8_t {
    kFound,
    kNotThere,  ///< what is there looks otherwise, or too little alike to tell the place
    kUnknown,   ///< there is no view of the patch that could be looked for
  };
  Result result = Result::kUnknown;
  Vector2d pixel = Vector2d::Zero();  ///< raw, where it was found

  [[nodiscard]] bool found() const noexcept { return result == Result::kFound; }
};

/// Where in `current` the warped piece of `reference` is, near `start` (raw pixels): Gauss-Newton
/// on the position alone, with mean and contrast of the patches made equal. Without the warp
/// Lucas-Kanade prefers, on a floor seen at a slant, the far and finer texture of its window, which
/// moves less: the motion comes out too small, and errors add up from frame to frame.
/// Source: Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 2004 (inverse compositional).
/// Unknown where the patch leaves the reference. Not there where it leaves `current`, strays from
/// `start`, looks like another one, or where its own contrast or what is left of differences says
/// that its place is uncertain. Pure.
[[nodiscard]] PatchSearch align_patch(const ImagePyramid& reference, const PatchWarp& warp,
                                      const ImagePyramid& current, const Vector2d& start);

}  // namespace geoflow::slam
