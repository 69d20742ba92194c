#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string_view>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"

namespace geoflow::daemon {

/// The signs of life of a thread that waits at a doorbell. wait(), turn() and end() are for that
/// thread; activity() is for any.
class Pulse {
 public:
  /// Waits at the bell, which takes no work: an absent sensor makes a thread idle, not stuck.
  timesync::Doorbell::Wake wait(timesync::Doorbell& bell,
                                std::optional<Duration> timeout = std::nullopt) noexcept {
    waiting_.store(true, std::memory_order_release);
    const auto wake = bell.wait(timeout);
    waiting_.store(false, std::memory_order_release);
    turn();
    return wake;
  }
  /// A piece of work is done.
  void turn() noexcept { turns_.fetch_add(1, std::memory_order_relaxed); }
  /// The thread has nothing more to do.
  void end() noexcept { ended_.store(true, std::memory_order_release); }

  /// A thread that waits at a bell which has rung is not idle: it should be on its way.
  [[nodiscard]] ThreadActivity activity(std::string_view name,
                                        const timesync::Doorbell& bell) const noexcept {
    const bool waits = waiting_.load(std::memory_order_acquire) && !bell.rung();
    return {.name = name,
            .turns = turns_.load(std::memory_order_relaxed),
            .idle = waits || ended_.load(std::memory_order_acquire)};
  }

 private:
  std::atomic<std::uint64_t> turns_{0};
  std::atomic<bool> waiting_{false};
  std::atomic<bool> ended_{false};
};

}  // namespace geoflow::daemon
