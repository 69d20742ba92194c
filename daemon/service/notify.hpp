#pragma once

#include <string>

#include "geoflow/hal/time.hpp"

/// What a service tells its manager (sd_notify(3)): datagrams to the socket that $NOTIFY_SOCKET
/// names. Without one, which is so outside systemd, nothing is sent. Any thread; no errors: a
/// manager that cannot be told is noted in the log, once.
namespace geoflow::daemon::service {

/// READY=1 with a first STATUS=: the sockets can be connected to.
void notify_ready(const std::string& status);
/// STATUS=, one line that `systemctl status` shows.
void notify_status(const std::string& status);
/// RELOADING=1: the configuration is being read again; notify_ready() ends that.
void notify_reloading();
/// STOPPING=1 with a last STATUS=.
void notify_stopping(const std::string& status);
/// WATCHDOG=1: all is alive.
void notify_watchdog();

/// Within which time the manager wants to hear notify_watchdog(), from $WATCHDOG_USEC; zero where
/// it does not. A value that is none is noted in the log and taken as zero.
[[nodiscard]] Duration watchdog_period();

}  // namespace geoflow::daemon::service
