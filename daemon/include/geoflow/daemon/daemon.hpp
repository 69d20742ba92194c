#pragma once

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// Runs the daemon on the calling thread, which must be the process's only one: sockets (its own,
/// or those that a service manager passed on), source, estimator, until the source has ended and
/// its clients have the last pose, or SIGINT or SIGTERM asks it to stop; both are kOk. A camera
/// that is not there is waited for. The service manager is told of all that (docs/service.md).
/// SIGHUP is noted and ignored. Errors: of the configuration, the sockets (kUnavailable where
/// another daemon holds them) and a recording.
[[nodiscard]] Result<ExitCode> run_daemon(const Config& config);

}  // namespace geoflow::daemon
