#pragma once

#include <atomic>
#include <optional>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::timesync {

/// Wakes the one thread that serves some queues: ring after a push, wait when all of them are
/// empty. Kept beside the queues so that they stay wait-free and one bell can serve several of
/// them.
///
/// An eventfd: it can also be watched by poll or epoll (fd(), then clear() before the queues are
/// looked at). A ring that nobody has answered yet costs no second system call. No ring is lost:
/// the waiter clears before it looks.
class Doorbell {
 public:
  enum class Wake { kRung, kTimeout, kStopped };

  /// Error kSystem when the system has no descriptor left.
  [[nodiscard]] static Result<Doorbell> create();
  Doorbell(Doorbell&& other) noexcept;  ///< before any other thread knows it
  Doorbell(const Doorbell&) = delete;
  Doorbell& operator=(const Doorbell&) = delete;
  Doorbell& operator=(Doorbell&&) = delete;
  ~Doorbell() = default;

  /// Any thread; never blocks.
  void ring() noexcept;
  /// Any thread; from now on every wait returns kStopped at once. Fit for a std::stop_callback.
  void stop() noexcept;
  [[nodiscard]] bool stopped() const noexcept { return stopped_.load(std::memory_order_acquire); }

  /// Any thread: rung, and the waiting thread has not answered yet.
  [[nodiscard]] bool rung() const noexcept { return rung_.load(std::memory_order_acquire); }

  /// The waiting thread only: returns when rung since the last wait (or clear), stopped, or after
  /// `timeout` (none: no limit; rounded up to whole milliseconds).
  [[nodiscard]] Wake wait(std::optional<Duration> timeout = std::nullopt) noexcept;

  /// Readable while rung or stopped, for epoll.
  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  /// The waiting thread only: makes fd() unreadable again, unless stopped.
  void clear() noexcept;

 private:
  explicit Doorbell(UniqueFd fd) noexcept;
  void signal() noexcept;

  UniqueFd fd_;
  std::atomic<bool> rung_{false};
  std::atomic<bool> stopped_{false};
};

}  // namespace geoflow::timesync
