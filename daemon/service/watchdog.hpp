#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {

/// Decides when the service manager may hear that all is alive: a few times a period, as long as no
/// thread is stuck. A thread is stuck when it has had work for a whole period and not moved (for
/// ten periods, where one piece of its work may be long). One that waits for a sensor that is away
/// has no work. The caller's own thread shows its life by calling look(). Thread-compatible; reads
/// no clock.
class Watchdog {
 public:
  /// A period of zero: nobody listens, and look() never asks for a word.
  explicit Watchdog(Duration period) : period_{period} {}

  /// What is to be done now.
  struct Verdict {
    bool feed = false;         ///< tell the manager
    std::string_view stuck{};  ///< name of a thread that is stuck; empty: none
  };
  [[nodiscard]] Verdict look(std::span<const ThreadActivity> threads, HostTime now);

 private:
  struct Seen {
    std::uint64_t turns = 0;
    HostTime moved;
  };
  [[nodiscard]] bool is_stuck(const ThreadActivity& thread, HostTime now);

  Duration period_;
  std::optional<HostTime> fed_;
  std::unordered_map<std::string_view, Seen> seen_;
};

}  // namespace geoflow::daemon::service
