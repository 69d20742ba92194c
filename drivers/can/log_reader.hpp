#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

/// A `candump -L` log as a recording of legs.
namespace geoflow::drivers::can {

/// Whether `path` is a file whose first line is one of candump's.
[[nodiscard]] bool looks_like_log(const std::filesystem::path& path);

/// The recording in a log. Its dictionary is `dictionary`; none: the only .dbc file beside the log;
/// where there is none, the one that comes with the program. A line that is no frame is one
/// rejected sample; a log without a single snapshot of the legs is an error.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open_log(
    const std::filesystem::path& path, const std::optional<std::filesystem::path>& dictionary);

}  // namespace geoflow::drivers::can
