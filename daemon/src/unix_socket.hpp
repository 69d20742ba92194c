#pragma once

#include <filesystem>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// A socket of this type (SOCK_SEQPACKET or SOCK_STREAM) that is connected to the daemon's.
/// kUnavailable where there is no such socket or nobody listens; kInvalidArgument for a path that
/// is too long for a socket; kSystem.
[[nodiscard]] Result<UniqueFd> connect_to(const std::filesystem::path& socket, int type);

/// Waits until there is something to read: true; false after `timeout` (negative counts as zero) or
/// a signal. kSystem.
[[nodiscard]] Result<bool> wait_readable(int fd, Duration timeout);

}  // namespace geoflow::daemon
