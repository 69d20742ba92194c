#pragma once

#include <csignal>

namespace geoflow::tools {

/// While it lives, SIGINT and SIGTERM only set a flag, so that a verb can finish in order; a second
/// one of the same kind ends the process as usual. One at a time.
class InterruptScope {
 public:
  InterruptScope();
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;
  ~InterruptScope();

  /// Whether one of them came.
  [[nodiscard]] static bool requested() noexcept;

 private:
  struct sigaction interrupt_{};
  struct sigaction terminate_{};
};

}  // namespace geoflow::tools
