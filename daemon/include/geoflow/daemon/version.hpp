#pragma once

#include <string_view>

namespace geoflow::daemon {

/// The version of this build, `major.minor.patch`.
[[nodiscard]] std::string_view version() noexcept;

}  // namespace geoflow::daemon
