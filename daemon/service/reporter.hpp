#pragma once

#include <optional>
#include <span>
#include <string>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/time.hpp"

#include "service/change_log.hpp"
#include "service/status_line.hpp"
#include "service/watchdog.hpp"

namespace geoflow::daemon::service {

/// Keeps the service manager informed (notify.hpp): that the daemon is ready, how it is, that it is
/// alive. Thread-bound: the event loop's, whose turning is a part of being alive.
class Reporter {
 public:
  explicit Reporter(Duration watchdog_period) : watchdog_{watchdog_period} {}

  /// The sockets can be connected to. Told once.
  void ready();
  /// Feeds the watchdog unless a thread is stuck, which is logged. To be called ten times a second.
  void watch(std::span<const ThreadActivity> threads, HostTime now);
  /// Whether it is time for tell(): once a second.
  [[nodiscard]] bool is_due(HostTime now) const noexcept;
  /// Tells how the daemon is, if that has changed; the log, too.
  void tell(const Observation& seen, HostTime now);
  /// The configuration is being read again, and, later, has been.
  void reloading() const;
  void reloaded();
  /// The status line as it was told last.
  [[nodiscard]] const std::string& told() const noexcept { return told_; }
  /// The daemon is about to end.
  void stopping(const std::string& why);

 private:
  Watchdog watchdog_;
  StatusLine line_;
  ChangeLog changes_;
  std::string stuck_;  // name of a thread
  std::string told_;
  std::optional<HostTime> told_at_;
  bool ready_ = false;
};

}  // namespace geoflow::daemon::service
