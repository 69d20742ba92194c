#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::tools {

/// The inertial samples of a recording.
struct ImuRecording {
  std::vector<Timed<ImuSample>> samples;  ///< on the clock that stamped them, unwrapped
  std::uint64_t rejected = 0;             ///< that could not be read
  std::string serial;                     ///< the camera's; empty where the recording does not say
  std::uint64_t hash = 0;                 ///< FNV-1a of stamps and values, to know the input again
};

/// Reads them, and nothing else of the recording. Errors: as RecordedStreams::open(); kNotFound
/// where it has no inertial samples.
[[nodiscard]] Result<ImuRecording> read_imu(const std::filesystem::path& recording);

}  // namespace geoflow::tools
