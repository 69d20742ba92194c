#include "geoflow/slam/stage.hpp"

namespace geoflow::slam {

const char* to_string(Stage stage) noexcept {
  switch (stage) {
    case Stage::kPyramid:
      return "pyramid";
    case Stage::kFlow:
      return "flow";
    case Stage::kCloud:
      return "cloud";
    case Stage::kPoseInitialisation:
      return "pose_initialisation";
    case Stage::kPoseOptimisation:
      return "pose_optimisation";
    case Stage::kFeatures:
      return "features";
    case Stage::kKeyframe:
      return "keyframe";
    case Stage::kMapping:
      return "mapping";
    case Stage::kGlobalMapping:
      return "global_mapping";
  }
  return "?";
}

}  // namespace geoflow::slam
