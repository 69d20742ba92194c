#include "geoflow/timesync/doorbell.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include <sys/eventfd.h>
#include <sys/poll.h>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::timesync {
namespace {

int poll_timeout_ms(std::optional<Duration> timeout) {
  if (!timeout) {
    return -1;
  }
  constexpr Duration kOneMs = std::chrono::milliseconds{1};
  const std::int64_t rounded_up =
      *timeout / kOneMs + (*timeout % kOneMs > Duration::zero() ? 1 : 0);
  return static_cast<int>(std::clamp<std::int64_t>(rounded_up, 0, std::numeric_limits<int>::max()));
}

}  // namespace

Result<Doorbell> Doorbell::create() {
  UniqueFd fd{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  if (!fd) {
    return fail_errno("eventfd");
  }
  return Doorbell{std::move(fd)};
}

Doorbell::Doorbell(UniqueFd fd) noexcept : fd_{std::move(fd)} {}

Doorbell::Doorbell(Doorbell&& other) noexcept
    : fd_{std::move(other.fd_)}, rung_{other.rung_.load()}, stopped_{other.stopped_.load()} {}

void Doorbell::ring() noexcept {
  if (!rung_.exchange(true, std::memory_order_acq_rel)) {
    signal();
  }
}

void Doorbell::stop() noexcept {
  stopped_.store(true, std::memory_order_release);
  signal();
}

Doorbell::Wake Doorbell::wait(std::optional<Duration> timeout) noexcept {
  pollfd watched{.fd = fd_.get(), .events = POLLIN, .revents = 0};
  int ready = 0;
  do {
    ready = ::poll(&watched, 1, poll_timeout_ms(timeout));
  } while (ready < 0 && errno == EINTR && !stopped());
  if (stopped()) {
    return Wake::kStopped;
  }
  clear();
  return ready > 0 ? Wake::kRung : Wake::kTimeout;
}

void Doorbell::clear() noexcept {
  if (stopped()) {
    return;
  }
  // Read first: a ring between the two lines finds rung_ set and adds nothing, but its push came
  // before our look at the queues; a ring after the second line signals anew.
  std::uint64_t count = 0;
  [[maybe_unused]] const auto bytes =
      ::read(fd_.get(), &count, sizeof count);  // EAGAIN: was not rung
  rung_.exchange(false, std::memory_order_acq_rel);
  if (stopped()) {
    signal();  // the stop that came meanwhile must stay readable
  }
}

void Doorbell::signal() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto bytes =
      ::write(fd_.get(), &one, sizeof one);  // fails only when already readable
}

}  // namespace geoflow::timesync
