#pragma once

#include <memory>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers {

/// The reader for the recording at `options.path`, chosen by what is there. An Error that fits none
/// lists what was looked for.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open_recording(
    const RecordingOptions& options);

}  // namespace geoflow::drivers
