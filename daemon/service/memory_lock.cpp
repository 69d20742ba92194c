#include "service/memory_lock.hpp"

#include <array>
#include <cerrno>
#include <system_error>

#include <linux/capability.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>  // NOLINT(misc-include-cleaner): SYS_capget
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::daemon::service {
namespace {

tl::unexpected<Error> not_allowed(int number) {
  return fail(
      ErrorCode::kSystem,
      "{}; a service is given it by LimitMEMLOCK=infinity in its unit, a shell's program by "
      "ulimit -l unlimited",
      std::generic_category().message(number));
}

bool is_unlimited() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
}

/// To whoever may do so, the limit does not apply (capabilities(7), CAP_IPC_LOCK).
bool is_above_limits() {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> sets{};
  return ::syscall(SYS_capget, &header, sets.data()) == 0 &&
         (sets[CAP_TO_INDEX(CAP_IPC_LOCK)].effective & CAP_TO_MASK(CAP_IPC_LOCK)) != 0;
}

}  // namespace

Result<void> lock_memory() {
  if (!is_unlimited() && !is_above_limits()) {
    return not_allowed(EPERM);
  }
  // Of stacks and pools that are never used, nothing comes into memory.
  return ::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0 ? Result<void>{}
                                                                 : not_allowed(errno);
}

}  // namespace geoflow::daemon::service
