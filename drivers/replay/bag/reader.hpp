#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

/// rosbag2 recordings.
namespace geoflow::drivers::bag {

/// Whether `path` is a rosbag2 folder or one of its database files, by names alone.
[[nodiscard]] bool looks_like(const std::filesystem::path& path);

/// The recording at `path`; its topics and calibration are found on the way. kNotFound with a list
/// of its topics where none of them is a colour or depth image.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path,
                                                            const TopicNames& names);

}  // namespace geoflow::drivers::bag
