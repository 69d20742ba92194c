#include "service/watchdog.hpp"

#include <span>
#include <string_view>

#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr int kFeedsInAPeriod = 4;      // sd_watchdog_enabled(3) recommends at least two
constexpr int kPeriodsOfLongWork = 10;  // a pose graph of a large map, or its file on a slow disk

}  // namespace

Watchdog::Verdict Watchdog::look(std::span<const ThreadActivity> threads, HostTime now) {
  if (period_ <= Duration::zero()) {
    return {};
  }
  Verdict verdict;
  for (const ThreadActivity& thread : threads) {
    if (is_stuck(thread, now)) {
      verdict.stuck = thread.name;
    }
  }
  if (verdict.stuck.empty() && (!fed_ || now - *fed_ >= period_ / kFeedsInAPeriod)) {
    fed_ = now;
    verdict.feed = true;
  }
  return verdict;
}

bool Watchdog::is_stuck(const ThreadActivity& thread, HostTime now) {
  const auto [place, is_new] =
      seen_.try_emplace(thread.name, Seen{.turns = thread.turns, .moved = now});
  Seen& seen = place->second;
  if (is_new || thread.idle || thread.turns != seen.turns) {
    seen = {.turns = thread.turns, .moved = now};
    return false;
  }
  return now - seen.moved > (thread.long_work ? kPeriodsOfLongWork : 1) * period_;
}

}  // namespace geoflow::daemon::service
