#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {

/// Writes live_camera.txt, live_base.txt, final_camera.txt, final_base.txt, estimates.csv and
/// report.json. Each file is replaced as a whole or not at all.
[[nodiscard]] Result<void> write_outputs(const std::filesystem::path& directory,
                                         const ReplayResult& result, const nlohmann::json& report);

}  // namespace geoflow::tools
