#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::scannet {

/// Whether `path` is a `.sens` file, or a folder with exactly one.
[[nodiscard]] bool looks_like(const std::filesystem::path& path);

/// A scan of ScanNet as its `.sens` file. Colour is resampled to the depth camera's size and
/// intrinsics, and depth moved to the colour camera by the extrinsics, so that both share one
/// camera; reference() is that camera in the reconstruction's world, without the frames that it
/// lost. Times are the file's where every stamp is larger than the one before; in most files they
/// are zero or noise, and frames then follow each other at 30 Hz, as they were recorded. A file
/// that ends early gives the frames it has, then an Error.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path);

}  // namespace geoflow::drivers::scannet
