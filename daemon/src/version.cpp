#include "geoflow/daemon/version.hpp"

#include <string_view>

namespace geoflow::daemon {

std::string_view version() noexcept {
  return GEOFLOW_VERSION;
}

}  // namespace geoflow::daemon
