#pragma once

#include <filesystem>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"

namespace geoflow::tools {

/// Writes one line of CSV for each pair: time, aligned estimate, reference, errors. Replaces an
/// existing file.
[[nodiscard]] Result<void> write_error_table(const Evaluation& evaluation,
                                             const std::filesystem::path& path);

}  // namespace geoflow::tools
