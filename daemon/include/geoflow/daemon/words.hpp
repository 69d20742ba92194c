#pragma once

#include <string>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// `12 s`, `4 min`, `3 h`, `5 d`: whole units, rounded down. Pure.
[[nodiscard]] std::string in_words(Duration duration);

}  // namespace geoflow::daemon
