#pragma once

#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/gicp.hpp"
#include "map/map.hpp"
#include "odometry/frame.hpp"
#include "odometry/pose_optimiser.hpp"
#include "vision/camera_model.hpp"
#include "vision/dual_stream_flow.hpp"

namespace geoflow::slam {

/// A frame found in the map.
struct Relocation {
  /// A map point where it was found in the frame.
  struct Track {
    PointId point;
    Vector2d raw;  ///< [px]
  };

  KeyframeId keyframe;  ///< in whose view it was found
  SE3 T_odom_cam;
  std::vector<Track> tracks;  ///< may be few where depth confirmed the pose
};

/// Finds where a frame is in the map without knowing where it should be. Pure; thread-safe.
class Relocaliser {
 public:
  Relocaliser(const Config& config, const GicpConfig& gicp, const CameraModel& camera)
      : config_{config}, gicp_{gicp}, camera_{camera}, flow_{config.flow, camera_} {}

  /// Looks in the newest part of the map.
  /// Hypotheses are looked for in the newest few keyframes and, of all, those that look most like
  /// the frame: pairs of descriptors give one by P3P with RANSAC on the keyframe's depth; where
  /// none does, registration of depth to the newest from `T_odom_cam_guess` and around it does. A
  /// hypothesis is believed when the keyframe's map points, projected with it, are found by optical
  /// flow from the keyframe's image and agree on one pose, or the two views' depth lies on one
  /// surface nearly everywhere and leaves no direction open. Where the keyframe's image was let go,
  /// its points are looked for by their descriptors, and both is asked for: these are no witnesses
  /// of their own. Where there are no points to follow, the depth has to fit nearly everywhere and
  /// to leave no direction open. The frame must have its PlaceView.
  [[nodiscard]] std::optional<Relocation> find(const Map& map, const Frame& frame,
                                               const SE3& T_odom_cam_guess) const;

 private:
  struct Hypothesis {
    SE3 T_odom_cam;
    bool certain = false;  ///< needs no confirmation by flow
  };
  /// Keyframes to be tried, in this order.
  [[nodiscard]] static std::vector<KeyframeId> candidates(const Map& map, const Frame& frame);
  /// Features of the keyframe, in place, that look like features of the frame.
  [[nodiscard]] std::vector<VisualMatch> pairs(const Frame& frame, const Keyframe& keyframe) const;
  [[nodiscard]] static bool depth_confirms(const Frame& frame, const Keyframe& keyframe,
                                           const RegistrationResult& found);
  [[nodiscard]] bool features_support(const Frame& frame, const Keyframe& keyframe,
                                      const SE3& T_odom_cam) const;
  [[nodiscard]] std::optional<Hypothesis> by_features(const Frame& frame,
                                                      const Keyframe& keyframe) const;
  /// A pose from few features, made better by depth where there is any.
  [[nodiscard]] Hypothesis refined(const Frame& frame, const Keyframe& keyframe,
                                   const SE3& T_odom_cam) const;
  /// Where the keyframe's points are in its image, and should be in the frame's.
  [[nodiscard]] std::vector<FlowSeed> seeds(const Map& map, KeyframeId id,
                                            const SE3& T_odom_cam) const;
  /// Where the keyframe's points are found in the frame, by flow or, without the keyframe's image,
  /// by descriptors; raw pixels.
  [[nodiscard]] std::vector<std::optional<Vector2d>> find_points(const Map& map, const Frame& frame,
                                                                 KeyframeId id,
                                                                 const SE3& T_odom_cam) const;
  [[nodiscard]] std::optional<Relocation> confirmed(const Map& map, const Frame& frame,
                                                    KeyframeId id,
                                                    const Hypothesis& hypothesis) const;
  [[nodiscard]] static bool depth_agrees(const Frame& frame, const Keyframe& keyframe,
                                         const SE3& T_odom_cam);
  [[nodiscard]] std::optional<Relocation> by_depth(const Map& map, const Frame& frame,
                                                   KeyframeId id,
                                                   const SE3& T_odom_cam_guess) const;

  Config config_;
  GicpConfig gicp_;
  CameraModel camera_;
  DualStreamFlow flow_;
};

}  // namespace geoflow::slam
