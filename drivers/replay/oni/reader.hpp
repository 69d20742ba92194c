#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::oni {

/// Whether `path` is a file that begins as an OpenNI recording does.
[[nodiscard]] bool looks_like(const std::filesystem::path& path);

/// A recording of OpenNI (.oni), its first colour and its first depth stream, without OpenNI: depth
/// compressed by 16z with and without table, or as it is; colour as JPEG, RGB888, YUV422, YUYV or
/// GRAY8. Depth is taken as it lies: whether it was registered to colour, the file does not say.
/// Intrinsics are those of the recorded fields of view, with the centre in the middle. Each
/// stream's times start at 0, as OpenNI's recorder has it. A file that ends early gives the frames
/// that it has, then an Error. kUnsupported for other codecs, or streams of different sizes.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path);

}  // namespace geoflow::drivers::oni
