#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {

/// Makes the output folder if it is not there, and checks that files can be written to it, before
/// any work is done.
[[nodiscard]] Result<void> prepare_output(const std::filesystem::path& directory);

/// Writes live_camera.txt, live_base.txt, final_camera.txt, final_base.txt, estimates.csv and
/// report.json. Each file is replaced as a whole or not at all.
[[nodiscard]] Result<void> write_outputs(const std::filesystem::path& directory,
                                         const ReplayResult& result, const nlohmann::json& report);

}  // namespace geoflow::tools
