#pragma once

#include <filesystem>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// Steps through the recording, which must not have been stepped before, and draws eight of its
/// colour images, evenly chosen, each above the depth image nearest behind it. Errors: it has no
/// images; the file.
[[nodiscard]] Result<void> draw_sheet(drivers::RecordedStreams& streams,
                                      const std::filesystem::path& path);

}  // namespace geoflow::tools
