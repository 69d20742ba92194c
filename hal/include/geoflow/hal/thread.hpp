#pragma once

#include "geoflow/hal/result.hpp"

namespace geoflow {

/// Lets all other threads go before the calling one, of this process and of others (nice 10), from
/// here on. For work that others must not wait for. It needs no privilege and cannot be taken back
/// without one.
void give_way() noexcept;

/// Lets the calling thread go before all ordinary ones (SCHED_FIFO at `priority`, 1 to 99), of this
/// process and of others, from here on; threads that it starts are ordinary. kSystem, with what
/// would allow it, where that is not allowed: it then goes on as it was.
[[nodiscard]] Result<void> go_first(int priority);

}  // namespace geoflow
