#include "geoflow/daemon/words.hpp"

#include <chrono>
#include <string>

#include <fmt/core.h>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

std::string in_words(Duration duration) {
  using std::chrono::duration_cast;
  if (duration >= std::chrono::days{2}) {
    return fmt::format("{} d", duration_cast<std::chrono::days>(duration).count());
  }
  if (duration >= std::chrono::hours{2}) {
    return fmt::format("{} h", duration_cast<std::chrono::hours>(duration).count());
  }
  if (duration >= std::chrono::minutes{2}) {
    return fmt::format("{} min", duration_cast<std::chrono::minutes>(duration).count());
  }
  return fmt::format("{} s", duration_cast<std::chrono::seconds>(duration).count());
}

}  // namespace geoflow::daemon
