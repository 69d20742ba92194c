#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::tum {

/// Whether `directory` has rgb.txt and depth.txt, or a list of associations.
[[nodiscard]] bool looks_like(const std::filesystem::path& directory);

/// What looks_like() looks for, for error messages.
[[nodiscard]] const char* expected_files();

/// A directory of the TUM RGB-D benchmark: rgb.txt and depth.txt, else associations.txt (or
/// association.txt, associate.txt, associated.txt). All listed files must exist. Its
/// accelerometer.txt (no gyroscope) and groundtruth.txt are not read.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& directory);

}  // namespace geoflow::drivers::tum
