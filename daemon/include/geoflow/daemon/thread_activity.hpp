#pragma once

#include <cstdint>
#include <string_view>

namespace geoflow::daemon {

/// What one thread shows of itself, for a watchdog: one whose `turns` stand still while it is not
/// idle is stuck, when that lasts too long.
struct ThreadActivity {
  std::string_view name;    ///< the thread's; of static duration
  std::uint64_t turns = 0;  ///< changes with every piece of work
  bool idle = false;        ///< waits, and nothing that it should work on waits for it
  bool long_work = false;   ///< one piece of work may take many seconds
};

}  // namespace geoflow::daemon
