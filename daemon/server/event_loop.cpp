#include "server/event_loop.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <functional>
#include <memory>
#include <utility>

#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {
namespace {

constexpr int kEventsAtOnce = 64;

timespec to_timespec(Duration duration) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(duration);
  return {.tv_sec = seconds.count(), .tv_nsec = (duration - seconds).count()};
}

}  // namespace

Result<std::unique_ptr<EventLoop>> EventLoop::create() {
  UniqueFd epoll{::epoll_create1(EPOLL_CLOEXEC)};
  if (!epoll) {
    return fail_errno("epoll_create1");
  }
  return std::unique_ptr<EventLoop>{new EventLoop{
      std::move(epoll)}};  // NOLINT(cppcoreguidelines-owning-memory): private constructor
}

Result<void> EventLoop::add(int fd, std::uint32_t events, Handler handler) {
  epoll_event event{.events = events, .data = {.fd = fd}};
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0) {
    return fail_errno("epoll_ctl");
  }
  handlers_[fd] = std::make_shared<Handler>(std::move(handler));
  return {};
}

void EventLoop::modify(int fd, std::uint32_t events) {
  epoll_event event{.events = events, .data = {.fd = fd}};
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &event);
}

void EventLoop::remove(int fd) {
  if (handlers_.erase(fd) > 0) {
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
  }
}

Result<void> EventLoop::add_timer(Duration period, std::function<void()> handler) {
  UniqueFd timer{::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)};
  const itimerspec spec{.it_interval = to_timespec(period), .it_value = to_timespec(period)};
  if (!timer || ::timerfd_settime(timer.get(), 0, &spec, nullptr) != 0) {
    return fail_errno("timerfd");
  }
  const int fd = timer.get();
  timers_.push_back(std::move(timer));
  return add(fd, EPOLLIN, [fd, handler = std::move(handler)](std::uint32_t /*events*/) {
    std::uint64_t expirations = 0;
    if (::read(fd, &expirations, sizeof expirations) > 0) {
      handler();
    }
  });
}

Result<void> EventLoop::dispatch_once() {
  std::array<epoll_event, kEventsAtOnce> events{};
  const int count = ::epoll_wait(epoll_.get(), events.data(), kEventsAtOnce, -1);
  if (count < 0) {
    return errno == EINTR ? Result<void>{} : fail_errno("epoll_wait");
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const auto found = handlers_.find(events.at(i).data.fd);
    if (found != handlers_.end()) {
      const std::shared_ptr<Handler> handler = found->second;  // kept alive should it remove itself
      (*handler)(events.at(i).events);
    }
  }
  return {};
}

Result<void> EventLoop::run() {
  running_ = true;
  while (running_) {
    auto dispatched = dispatch_once();
    if (!dispatched) {
      return dispatched;
    }
  }
  return {};
}

}  // namespace geoflow::daemon
