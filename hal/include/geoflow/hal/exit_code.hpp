#pragma once

#include <cstdint>

#include "geoflow/hal/result.hpp"

namespace geoflow {

/// Exit codes of `geoflow` and `geoflowd` (docs/cli.md).
enum class ExitCode : std::uint8_t {
  kOk = 0,
  kFailure =
      1,       ///< the work was begun and failed: operating system, disk, or a bar that was not met
  kUsage = 2,  ///< unknown option or configuration key, value out of range
  kBadInput = 3,     ///< a file or recording is missing, malformed or of an unsupported kind
  kUnavailable = 4,  ///< no daemon answers, or another one holds the socket
  kInterrupted =
      130,  ///< stopped by SIGINT or SIGTERM before the end; what was done so far is written
};

/// The exit code that stands for an error.
[[nodiscard]] ExitCode exit_code(const Error& error) noexcept;

/// The name of an error's kind in JSON output: "not_found", "invalid_data", "invalid_argument",
/// "unsupported", "unavailable", "system".
[[nodiscard]] const char* error_name(ErrorCode code) noexcept;

}  // namespace geoflow
