#include "geoflow/hal/thread.hpp"

#include <sys/resource.h>

namespace geoflow {

void give_way() noexcept {
  constexpr int kNice = 10;
  ::setpriority(PRIO_PROCESS, 0, kNice);  // to Linux, 0 is this thread
}

}  // namespace geoflow
