#include "geoflow/hal/thread.hpp"

#include <cerrno>
#include <system_error>

#include <sched.h>
#include <sys/resource.h>

#include "geoflow/hal/result.hpp"

namespace geoflow {

void give_way() noexcept {
  constexpr int kNice = 10;
  ::setpriority(PRIO_PROCESS, 0, kNice);  // to Linux, 0 is this thread
}

Result<void> go_first(int priority) {
  const sched_param wanted{.sched_priority = priority};
  if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) == 0) {
    return {};
  }
  return fail(ErrorCode::kSystem,
              "real-time priority {} is not allowed: {}; a service is given it by LimitRTPRIO= and "
              "RestrictRealtime=no in its unit, a shell's program by ulimit -r",
              priority, std::generic_category().message(errno));
}

}  // namespace geoflow
