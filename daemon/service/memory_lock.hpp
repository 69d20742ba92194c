#pragma once

#include "geoflow/hal/result.hpp"

namespace geoflow::daemon::service {

/// Keeps in memory, from here on, whatever this process has there or comes to use. kSystem, with
/// what would allow it, where that is not allowed: nothing has changed then. A limit on locked
/// memory does not allow it either, since reaching it would end the process. Any thread.
[[nodiscard]] Result<void> lock_memory();

}  // namespace geoflow::daemon::service
