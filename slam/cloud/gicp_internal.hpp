#pragma once

#include "cloud/gicp.hpp"

namespace geoflow::slam {

/// linearise() with the association of one stage.
[[nodiscard]] NormalEquations linearise_stage(const DepthCloud& source, const DepthCloud& target,
                                              const SE3& T_target_source, const GicpStage& stage,
                                              const GicpConfig& config);

}  // namespace geoflow::slam
