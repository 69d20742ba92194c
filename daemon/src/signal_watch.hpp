#pragma once

#include <functional>
#include <initializer_list>
#include <memory>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/event_loop.hpp"

namespace geoflow::daemon {

/// Signals as events of the loop. Blocks them for the calling thread and for those that it starts
/// later, so it must come before any other thread; the mask stays. Thread-bound: the loop's.
class SignalWatch {
 public:
  using Handler = std::function<void(int signal)>;

  [[nodiscard]] static Result<std::unique_ptr<SignalWatch>> create(
      EventLoop& loop, std::initializer_list<int> signals, Handler handler);
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;
  ~SignalWatch();

 private:
  SignalWatch(EventLoop& loop, UniqueFd fd) : loop_{loop}, fd_{std::move(fd)} {}

  EventLoop& loop_;
  UniqueFd fd_;
};

}  // namespace geoflow::daemon
