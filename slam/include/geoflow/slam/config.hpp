#pragma once

#include <chrono>

#include "geoflow/hal/time.hpp"

/// What can be set of the estimator. Plain structs; every default is meant to be used.
namespace geoflow::slam {

/// The paper's components, each of which can be left out (its ablation rows).
struct Switches {
  bool optical_flow = true;  ///< dual-stream flow (IV-A); off: ORB features matched by projection
  /// Depth registered to the frame before: in the pose's first guess (IV-B), in its optimisation
  /// and between consecutive keyframes (IV-C, equation (5)).
  bool gicp = true;
  /// Depth registered to the map: surfels of keyframes that see the same surfaces (IV-C, equation
  /// (6)).
  bool depth_to_map = true;
  bool imu = true;  ///< the IMU predicts motion, where its place on the camera is known (IV-B)
  bool legs =
      true;  ///< so do legs or body velocities, where the camera's place on the robot is known
  /// Features are put where the middle of the image would have shown them, and the colour camera's
  /// readout is found out.
  bool rolling_shutter = true;
  bool loop_closing = true;  ///< places known again correct the map
};

// NOLINTBEGIN(readability-magic-numbers): each number is the value of a member that names it
/// Grid-spread ORB features (III-1).
struct FeatureConfig {
  int cell_px = 40;            ///< side of a grid cell [px]
  int features_per_cell = 2;   ///< strongest corners of a cell that are tracked
  int described_per_cell = 4;  ///< strongest corners of a cell by which the place is known again
  int fast_threshold = 7;      ///< FAST-9 contrast [gray levels]
  double mask_radius_px = 10;  ///< no new feature nearer than this to a tracked one [px]
};

/// Pyramidal Lucas-Kanade (IV-A).
struct FlowConfig {
  int window_px = 21;  ///< side of the window [px]
  /// The same of the 3D-to-2D stream, which begins near: less of what lies at another depth.
  int prior_window_px = 15;
  int prior_levels = 1;  ///< coarsest level of the 3D-to-2D stream, whose start is predicted
  int levels = 3;        ///< coarsest level of the 2D-to-2D stream
  double forward_backward_px = 0.7;       ///< a track must return to its start within this [px]
  double fundamental_threshold_px = 1.5;  ///< distance to the epipolar line [px]
};

/// Pose of one frame against the map (IV-B, IV-C).
struct PoseConfig {
  /// Least standard deviation of a tracked feature [px]: that within which a patch tells its place.
  double pixel_sigma = 0.3;
  int minimum_visual_inliers = 15;  ///< fewer do not count as a visual fix
  double pnp_threshold_px = 3.0;    ///< RANSAC inlier distance [px]
  int map_targets = 3;              ///< keyframes that a frame's depth is registered to at once
  int gicp_surfels = 1200;          ///< of a frame's depth, chosen for a well-conditioned pose
  int iterations = 5;               ///< Gauss-Newton steps at most
};

struct KeyframeConfig {
  double translation_m = 0.12;  ///< moved this far from the reference keyframe [m]
  double rotation_rad = 0.14;   ///< or turned this far [rad]
  double overlap = 0.7;         ///< or less than this share of its features or depth still in view
  Duration maximum_interval = std::chrono::seconds{2};
};

/// Local bundle adjustment (IV-C, figure 4).
struct MappingConfig {
  int window = 10;         ///< keyframes that move
  int fixed = 10;          ///< further keyframes that see the same points or surfaces, held
  int map_neighbours = 4;  ///< keyframes that a new one's depth is registered to
  int iterations = 8;
  double inverse_depth_sigma = 0.003;  ///< of what a feature's depth measures [1/m]
};
// NOLINTEND(readability-magic-numbers)

struct Config {
  Switches switches;
  FeatureConfig features;
  FlowConfig flow;
  PoseConfig pose;
  KeyframeConfig keyframes;
  MappingConfig mapping;
};

}  // namespace geoflow::slam
