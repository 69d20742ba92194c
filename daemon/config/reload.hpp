#pragma once

#include <string>
#include <vector>

#include "geoflow/daemon/config.hpp"

namespace geoflow::daemon {

/// What became of a configuration that was read again: keys by name.
struct Reload {
  std::vector<std::string> changed;  ///< now as they were read
  std::vector<std::string> restart;  ///< to be taken up at the next start
};

/// Takes from `read` into `running` the keys that can change at run time: limits of the sockets,
/// how often the map is saved, whether a recording begins again. `started` is what the daemon was
/// started with, which holds for all others. Pure.
[[nodiscard]] Reload take_over(const Config& read, const Config& started, Config& running);

}  // namespace geoflow::daemon
