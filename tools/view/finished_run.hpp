#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// What a folder that `geoflow replay` wrote says of the run, frame by frame, for a page with a
/// time line: the object of docs/view.md, "A finished run". Frames that have no live pose are left
/// out. Pure but for the files. Errors: a file that is missing or damaged, with its line; a run
/// without any pose.
[[nodiscard]] Result<nlohmann::json> read_finished_run(const std::filesystem::path& folder);

}  // namespace geoflow::tools
