#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// The first depth images of a recording that have a reference pose.
struct DepthSequence {
  Calibration calibration;
  std::vector<FrameRef> depth;
  std::vector<SE3> T_world_cam;
};

/// Reads up to `count` frames. The reference defaults to groundtruth.txt in the recording; a pose
/// belongs to a frame when their times differ by at most 10 ms.
[[nodiscard]] Result<DepthSequence> read_depth_sequence(
    const std::filesystem::path& recording, const std::optional<std::filesystem::path>& reference,
    std::size_t count);

}  // namespace geoflow::tools
