#include "service/reporter.hpp"

#include <chrono>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/time.hpp"

#include "service/notify.hpp"
#include "service/status_line.hpp"
#include "service/watchdog.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr Duration kTellEvery = std::chrono::seconds{1};

}  // namespace

void Reporter::ready() {
  if (!std::exchange(ready_, true)) {
    notify_ready(told_.empty() ? "STARTING" : told_);
  }
}

void Reporter::watch(std::span<const ThreadActivity> threads, HostTime now) {
  const Watchdog::Verdict verdict = watchdog_.look(threads, now);
  if (verdict.feed) {
    notify_watchdog();
  }
  if (verdict.stuck != stuck_) {
    stuck_ = verdict.stuck;
    if (stuck_.empty()) {
      log::warning("service", "all threads move again: the watchdog is fed");
    } else {
      log::error("service", "thread {} is stuck: the watchdog is no longer fed", stuck_);
    }
  }
}

bool Reporter::is_due(HostTime now) const noexcept {
  return !told_at_ || now - *told_at_ >= kTellEvery;
}

void Reporter::tell(const Observation& seen, HostTime now) {
  changes_.note(seen, now);
  std::string line = line_.update(seen, now);
  if (!stuck_.empty()) {
    line = fmt::format("thread {} is stuck; {}", stuck_, line);
  }
  told_at_ = now;
  if (line != told_) {
    notify_status(line);
    told_ = std::move(line);
  }
}

void Reporter::reloading() const {
  if (ready_) {
    notify_reloading();
  }
}

void Reporter::reloaded() {
  if (ready_) {
    notify_ready(told_.empty() ? "STARTING" : told_);
  }
}

void Reporter::stopping(const std::string& why) {
  notify_stopping(why);
}

}  // namespace geoflow::daemon::service
