#pragma once

#include <set>
#include <utility>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"

#include "map/map.hpp"
#include "map/mapping_problem.hpp"
#include "odometry/frame.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {

/// Makes keyframes of frames and local bundle adjustments of keyframes. Thread-bound.
class MapBuilder {
 public:
  MapBuilder(const Config& config, const GicpConfig& gicp, const Calibration& calibration,
             StageObserver* observer);

  /// Adds a tracked frame to the map: its features are observations of their points; points of
  /// nearby keyframes are looked for again; new features are spread over what is free, those with
  /// depth becoming points. The frame's features are extended by these.
  KeyframeId insert(Map& map, Frame& frame, const Matrix6d& covariance);

  /// The adjustment around a keyframe: the newest keyframes move; others that share points or
  /// surfaces are held.
  [[nodiscard]] MappingTask task(const Map& map, KeyframeId newest) const;

  /// The adjustment of all keyframes of the newest part, and what they observe (global bundle
  /// adjustment): the oldest is held.
  [[nodiscard]] MappingTask whole_map_task(const Map& map) const;

  /// Takes a solution over into the map. Keyframes younger than the solution's newest move along
  /// with it. Returns the motion of that newest keyframe: T_odom1_odom0, to be applied on the left
  /// to whatever depends on it.
  [[nodiscard]] SE3 apply(Map& map, const MappingSolution& solution) const;

 private:
  [[nodiscard]] std::shared_ptr<MappingProblem> empty_problem() const;
  /// Pairs of keyframes whose depth is to be registered: the newest with those that see what it
  /// sees.
  [[nodiscard]] std::vector<EdgeToMeasure> edges_to_measure(const Map& map,
                                                            KeyframeId newest) const;
  /// Keyframes outside the window that are most connected with it, by points and by edges: its
  /// anchors.
  [[nodiscard]] std::set<KeyframeId> held_keyframes(const Map& map,
                                                    const std::set<KeyframeId>& moving,
                                                    const std::set<PointId>& points,
                                                    const MappingProblem& problem) const;
  void observe_features(Map& map, KeyframeId keyframe, Frame& frame) const;
  void triangulate(Map& map, KeyframeId keyframe, Feature& feature) const;
  void add_features(Map& map, KeyframeId keyframe, Frame& frame);
  void cull(Map& map, const Frame& frame) const;

  Config config_;
  GicpConfig gicp_;
  CameraModel camera_;
  double gyro_random_walk_;
  OrbExtractor orb_;
  StageObserver* observer_;
};

}  // namespace geoflow::slam
