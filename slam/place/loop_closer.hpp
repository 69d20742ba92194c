#pragma once

#include <memory>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/gicp.hpp"
#include "map/map.hpp"
#include "place/loop_problem.hpp"

namespace geoflow::slam {

/// Whether two views show one place, and the relative pose then: pairs of descriptors give a pose
/// by P3P with RANSAC on the old view's depth, or else odometry does, which guides the search for
/// more pairs; generalised ICP and the pairs refine it together; and the depth of each view has to
/// lie on the other's surfaces, beyond doubt where not enough pairs agree, and no direction may be
/// left open. Pure, deterministic, thread-safe.
[[nodiscard]] LoopSolution verify_loops(const LoopProblem& problem);

/// Decides which keyframes to compare, and which of the loops that were found to believe. A wrong
/// loop ruins a map, a missed one leaves it as it is: so a loop has to be found by three keyframes
/// that agree (or one that is certain beyond doubt), and has to be within what the way between can
/// have drifted. Thread-bound.
class LoopCloser {
 public:
  LoopCloser(const Config& config, const GicpConfig& gicp, const Calibration& calibration)
      : config_{config}, gicp_{gicp}, camera_{calibration.camera} {}

  /// Old keyframes that look like a new one, or whose depth it should see where odometry puts it,
  /// and that are not of its LocalMap. Null: none, or the keyframe has no place yet.
  [[nodiscard]] std::shared_ptr<const LoopProblem> problem(const Map& map, KeyframeId newest) const;

  /// Takes in what verify_loops() found, in order of keyframes, and returns the loops that are now
  /// to be closed. Keyframes' poses are those of the map at this time.
  [[nodiscard]] std::vector<RelativeEdge> consider(const Map& map, const LoopSolution& solution);

 private:
  Config config_;
  GicpConfig gicp_;
  CameraIntrinsics camera_;
  std::vector<LoopHypothesis> waiting_;  ///< not believed yet, in order of the new keyframe
};

}  // namespace geoflow::slam
