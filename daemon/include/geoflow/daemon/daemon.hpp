#pragma once

#include <functional>

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// Runs the daemon on the calling thread, which must be the process's only one: sockets (its own,
/// or those that a service manager passed on), source, estimator, until the source has ended and
/// its clients have the last pose, or SIGINT or SIGTERM asks it to stop; both are kOk. A camera
/// that is not there is waited for. The service manager and, where stderr is that, the journal are
/// told of all that (docs/service.md).
/// SIGHUP and the control socket's `reload` have the configuration read again by `read_config`,
/// which takes the place of `config` where it can change at run time; where it is wrong, nothing
/// changes. Errors: of the configuration, the sockets (kUnavailable where
/// another daemon holds them) and a recording.
[[nodiscard]] Result<ExitCode> run_daemon(const Config& config,
                                          std::function<Result<Config>()> read_config);

}  // namespace geoflow::daemon
