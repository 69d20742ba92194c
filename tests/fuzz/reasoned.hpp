#pragma once

#include <cstdlib>

namespace geoflow::tests {

/// Aborts where a decoder refuses its input without saying why. `result` is a Result of anything.
void require_reason(const auto& result) {
  if (!result && result.error().message.empty()) {
    std::abort();
  }
}

}  // namespace geoflow::tests
