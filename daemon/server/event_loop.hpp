#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <unordered_map>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// One epoll loop: calls a handler when its descriptor is ready. Thread-bound: every call from the
/// thread that runs it. Handlers may add and remove any descriptor, their own too.
class EventLoop {
 public:
  /// Gets the ready EPOLL* bits.
  using Handler = std::function<void(std::uint32_t events)>;

  [[nodiscard]] static Result<std::unique_ptr<EventLoop>> create();

  /// Watches `fd`, level-triggered, for EPOLL* bits until remove(); the caller keeps it open so
  /// long.
  [[nodiscard]] Result<void> add(int fd, std::uint32_t events, Handler handler);
  /// Changes what a watched descriptor is watched for.
  void modify(int fd, std::uint32_t events);
  /// Ends watching; harmless for one that is not watched. To be called before the descriptor is
  /// closed.
  void remove(int fd);

  /// Calls `handler` every `period` until the loop is destroyed.
  [[nodiscard]] Result<void> add_timer(Duration period, std::function<void()> handler);

  /// Dispatches until stop(). kSystem where epoll fails.
  [[nodiscard]] Result<void> run();
  void stop() noexcept { running_ = false; }

 private:
  explicit EventLoop(UniqueFd epoll) : epoll_{std::move(epoll)} {}
  [[nodiscard]] Result<void> dispatch_once();

  UniqueFd epoll_;
  std::unordered_map<int, std::shared_ptr<Handler>> handlers_;
  std::vector<UniqueFd> timers_;
  bool running_ = false;
};

}  // namespace geoflow::daemon
