#include "src/signal_watch.hpp"

#include <csignal>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <utility>

#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/event_loop.hpp"

namespace geoflow::daemon {

Result<std::unique_ptr<SignalWatch>> SignalWatch::create(EventLoop& loop,
                                                         std::initializer_list<int> signals,
                                                         Handler handler) {
  sigset_t set{};
  sigemptyset(&set);
  for (const int signal : signals) {
    sigaddset(&set, signal);
  }
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  UniqueFd fd{::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK)};
  if (!fd) {
    return fail_errno("signalfd");
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<SignalWatch> watch{new SignalWatch{loop, std::move(fd)}};
  auto added =
      loop.add(watch->fd_.get(), EPOLLIN,
               [number = watch->fd_.get(), handler = std::move(handler)](std::uint32_t /*events*/) {
                 signalfd_siginfo info{};
                 while (::read(number, &info, sizeof info) == sizeof info) {
                   handler(static_cast<int>(info.ssi_signo));
                 }
               });
  if (!added) {
    return tl::unexpected{std::move(added.error())};
  }
  return watch;
}

SignalWatch::~SignalWatch() {
  loop_.remove(fd_.get());
}

}  // namespace geoflow::daemon
