#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

/// When a recording's samples were taken.
namespace geoflow::tools {

/// One stream's stamps.
struct StreamTimes {
  std::string name;         ///< "color", "depth", "imu", "legs" or "body_velocity"
  std::vector<double> t_s;  ///< by the device's clock, since the stream's first sample
};

struct RecordingTimes {
  std::vector<StreamTimes> streams;  ///< those that have samples
  std::uint64_t rejected = 0;        ///< samples that could not be decoded
  bool interrupted = false;
};

/// Told after each sample how many there were; returning false interrupts.
using ReadingProgress = std::function<bool(std::uint64_t samples)>;

/// Reads a recording through, as a replay would; without faults. Errors as
/// drivers::RecordedStreams::open().
[[nodiscard]] Result<RecordingTimes> read_times(const std::filesystem::path& recording,
                                                const std::filesystem::path& calibration,
                                                const ReadingProgress& progress);

/// What stands out in one stream.
struct StreamGaps {
  double median_ms = 0;  ///< time from one sample to the next
  double longest_ms = 0;
  std::uint64_t gaps = 0;     ///< times longer than one and a half of the median
  std::uint64_t missing = 0;  ///< how many samples would fill them
};

/// Zero for fewer than two samples. Pure.
[[nodiscard]] StreamGaps find_gaps(const StreamTimes& stream);

/// The time from each sample to the next, a plot for each stream. Pure.
[[nodiscard]] Figure interval_figure(const RecordingTimes& times);

}  // namespace geoflow::tools
