#include "geoflow/hal/time.hpp"

#include <ctime>

namespace geoflow {

HostTime HostClock::now() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return HostTime{std::chrono::seconds{now.tv_sec} + std::chrono::nanoseconds{now.tv_nsec}};
}

}  // namespace geoflow
