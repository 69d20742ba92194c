#pragma once

#include <ctime>

namespace geoflow {

/// Time that a processor has worked for this thread, or for all of this process's, since some start
/// [s]: what other programs do meanwhile does not count. Thread-safe.
[[nodiscard]] inline double cpu_time_s(clockid_t clock) noexcept {
  constexpr double kSecondsPerNanosecond = 1e-9;
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + kSecondsPerNanosecond * static_cast<double>(now.tv_nsec);
}
[[nodiscard]] inline double thread_cpu_s() noexcept {
  return cpu_time_s(CLOCK_THREAD_CPUTIME_ID);
}
[[nodiscard]] inline double process_cpu_s() noexcept {
  return cpu_time_s(CLOCK_PROCESS_CPUTIME_ID);
}

}  // namespace geoflow
