#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "vision/camera_model.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/patch_alignment.hpp"

namespace geoflow::slam {

/// A feature of the previous frame that wants to be found in the current one. Raw pixels.
struct FlowSeed {
  Vector2d previous;
  /// Where the predicted pose puts its map point in the current image (paper, equation (1)); none
  /// for features without.
  std::optional<Vector2d> predicted;
};

/// Dual-stream optical flow (paper, section IV-A). Pure, thread-safe.
///
/// 1. 3D-to-2D: pyramidal Lucas-Kanade from the predicted pixels of features with a map point.
/// 2. 2D-to-2D: the rest and the first stream's failures, from where they were in the previous
/// image. Where the patch of a map point can be looked for, that decides; other tracks are checked
/// forward and backward, which noise and mirrored light pass as well as texture: on a dark floor
/// they lag behind the motion. Then the epipolar geometry of all tracks (fundamental matrix by
/// RANSAC) drops what does not move with the camera, and a mask keeps two tracks from ending at the
/// same place.
class DualStreamFlow {
 public:
  /// Looks for the patch of the seed of that number in the current image, from the raw pixel where
  /// flow has found it.
  using LookFor = std::function<PatchSearch(std::size_t seed, const Vector2d& pixel)>;

  DualStreamFlow(const FlowConfig& config, const CameraModel& camera)
      : config_{config}, camera_{camera} {}

  /// For each seed its raw pixel in `current`, or nothing. Earlier seeds win where the mask has to
  /// choose.
  [[nodiscard]] std::vector<std::optional<Vector2d>> track(const ImagePyramid& previous,
                                                           const ImagePyramid& current,
                                                           std::span<const FlowSeed> seeds,
                                                           const LookFor& look_for = {}) const;

 private:
  struct Stream;
  void track_stream(const Stream& stream, const std::vector<std::size_t>& chosen,
                    std::vector<std::optional<Vector2d>>& tracks) const;
  void reject_by_epipolar_geometry(std::span<const FlowSeed> seeds,
                                   std::vector<std::optional<Vector2d>>& tracks) const;
  void reject_double_occupancy(std::vector<std::optional<Vector2d>>& tracks) const;

  FlowConfig config_;
  CameraModel camera_;
};

}  // namespace geoflow::slam
