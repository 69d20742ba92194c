#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <tbb/task_group.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/depth_cloud.hpp"
#include "map/local_map.hpp"
#include "map/map.hpp"
#include "odometry/frame.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/patch_refiner.hpp"
#include "odometry/pose_optimiser.hpp"
#include "odometry/row_timing.hpp"
#include "place/relocaliser.hpp"
#include "vision/dual_stream_flow.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {

/// A frame against the map.
struct TrackingResult {
  PoseSolution solution;
  PoseSource source = PoseSource::kNone;
  bool visual_fix = false;  ///< enough map points agree with the pose
  bool depth_fix = false;   ///< enough of the frame's depth agrees with the pose
  /// The first guess was checked by enough of what it was made from, or legs made it from a frame
  /// that something seen had fixed.
  bool sure = false;
  bool anchored = false;  ///< the pose hangs together with the map (Frame::anchored)
  /// Of the pose in respect of the map, or, where it is not anchored, of the frame before.
  Matrix6d covariance = Matrix6d::Zero();
  double depth_share = 0;  ///< share of the frame's depth that agrees with the map, 0 to 1
  double overlap = 0;  ///< largest share of the frame's depth that one keyframe sees too, 0 to 1

  /// PoseEstimate::quality: how much of what could be seen carries the pose, 0 to 100.
  [[nodiscard]] std::uint8_t quality() const;
};

/// What is known of a frame's pose before it is looked at.
struct Prediction {
  PosePrior prior;  ///< from the last keyframe, by legs and IMU, or from the frame before
  PoseSource by{};  ///< what made it
  /// By legs and IMU alone from the last keyframe on; none where they do not know all of the way.
  std::optional<PosePrior> since_keyframe{};
};

/// Follows the camera from frame to frame against a map that others build: predict, track,
/// initialise, optimise, in the paper's order (sections IV-A to IV-C). Thread-bound.
class Tracker {
 public:
  Tracker(const Config& config, const GicpConfig& gicp, const Calibration& calibration,
          std::shared_ptr<const CellGrid> grid, StageObserver* observer);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;
  ~Tracker();

  /// Makes a packet's images the current frame, and the current frame the one before. Its depth is
  /// read on a thread of TBB's from now on; whatever needs it waits for it.
  void begin_frame(const SyncedPacket& packet);

  /// Pose of the current frame, given its prediction. Features that contradict it are dropped from
  /// the frame.
  [[nodiscard]] TrackingResult track(Map& map, const Prediction& predicted);

  [[nodiscard]] const ReadoutEstimate& readout() const noexcept { return rows_.readout(); }

  /// Waits until the frame is read.
  [[nodiscard]] Frame& current() {
    finish_frame();
    return current_;
  }

 private:
  struct InitialPose {
    SE3 T_odom_cam;
    PoseSource source{};
    bool sure = false;  ///< as in TrackingResult
  };
  void follow(const Map& map, const SE3& T_odom_cam_predicted);
  void build_cloud();
  void finish_frame();
  void follow_by_flow(const Map& map, const SE3& T_odom_cam_predicted);
  void follow_by_descriptors(const Map& map, const SE3& T_odom_cam_predicted);
  void describe();
  /// Looks for the current frame in the map without a prediction. On success its features are those
  /// of the map points in view.
  [[nodiscard]] std::optional<SE3> relocate(const Map& map, const SE3& T_odom_cam_predicted);
  /// What the frame's depth is registered to at a pose: the frame before (GICP between consecutive
  /// frames), unless `blind` to the motion since, and keyframes of the local map (depth to map);
  /// `overlap` as in TrackingResult.
  [[nodiscard]] std::vector<DepthTarget> depth_targets(const Map& map, const SE3& T_odom_cam,
                                                       bool blind, double& overlap);
  /// The frame's features that show map points, and, where asked for, which features they are.
  [[nodiscard]] std::vector<VisualMatch> matches(
      const Map& map, std::vector<std::size_t>* feature_of_match = nullptr) const;
  [[nodiscard]] InitialPose initial_pose(const InitialPose& predicted,
                                         std::span<const VisualMatch> matches) const;
  [[nodiscard]] InitialPose first_guess(const Map& map, const InitialPose& predicted, bool blind);
  void keep_inliers(Map& map, const std::vector<std::size_t>& feature_of_match,
                    const PoseSolution& solution);

  Config config_;
  GicpConfig gicp_;
  Calibration calibration_;
  CameraModel camera_;
  DualStreamFlow flow_;
  PatchRefiner refiner_;
  RowTiming rows_;
  PoseOptimiser optimiser_;
  OrbExtractor orb_;
  Relocaliser relocaliser_;
  std::shared_ptr<const CellGrid> grid_;
  StageObserver* observer_;
  std::optional<LocalMap> local_map_;  ///< of the newest keyframe
  Frame previous_;
  Frame current_;
  tbb::task_group cloud_building_;  ///< of the current frame
  bool fixed_ = true;               ///< the last frame, by points or depth
};

}  // namespace geoflow::slam
