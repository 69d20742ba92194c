#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {

struct RecordedWorldOptions {
  std::filesystem::path path;  ///< any recording that `geoflow replay` reads
  std::optional<std::filesystem::path> calibration{};  ///< folder with Kalibr files
  bool loop = false;  ///< begin again at the end, one frame's time after it
};

/// A recording as a world: its first sample is at 0. Times are the recording's device times where
/// camera and IMU were stamped by one clock or on the host's time line, else arrival times: a D435i
/// stamps both by one clock. A sample is sent when it arrived. Errors name file, line and key. A
/// recording without images is refused.
[[nodiscard]] Result<std::unique_ptr<World>> open_recorded_world(
    const RecordedWorldOptions& options);

}  // namespace geoflow::emulator
