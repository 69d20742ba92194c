#include "geoflow/hal/unique_fd.hpp"

#include <utility>

#include <unistd.h>

namespace geoflow {

void UniqueFd::reset(int fd) noexcept {
  const int old = std::exchange(fd_, fd);
  if (old >= 0) {
    ::close(old);
  }
}

}  // namespace geoflow
