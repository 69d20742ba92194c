#pragma once

#include <chrono>
#include <cstdint>

/// Clocks and times. Integer nanoseconds everywhere; `double` seconds only as differences inside
/// maths.
///
/// Every clock is a type of its own, so a camera's time cannot be compared with an IMU's or the
/// host's: it does not compile. The only bridge between a device's clock and the host's is
/// `timesync::ClockModel`.
namespace geoflow {

using Duration = std::chrono::nanoseconds;

/// The host's CLOCK_MONOTONIC. In an unpaced replay the recording's own time line stands in for it.
struct HostClock {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = Duration;
  using time_point = std::chrono::time_point<HostClock, Duration>;
  static constexpr bool is_steady =
      true;  // NOLINT(readability-identifier-naming): required by the Clock concept

  /// Reads CLOCK_MONOTONIC. Thread-safe; never fails.
  [[nodiscard]] static time_point now() noexcept;
};

using HostTime = HostClock::time_point;

/// The clock inside a device. It cannot be read, only seen on the samples that the device stamps.
template <typename Device>
struct DeviceClock {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = Duration;
  using time_point = std::chrono::time_point<DeviceClock, Duration>;
  static constexpr bool is_steady =
      true;  // NOLINT(readability-identifier-naming): required by the Clock concept
};

struct CameraDevice {};
struct ImuDevice {};
struct LegDevice {};

using CameraClock = DeviceClock<CameraDevice>;
using ImuClock = DeviceClock<ImuDevice>;
using LegClock = DeviceClock<LegDevice>;

template <typename Clock>
using DeviceTime = std::chrono::time_point<Clock, Duration>;

/// A duration in seconds, for maths.
[[nodiscard]] constexpr double to_seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

/// The nearest whole nanosecond to `seconds`. Undefined beyond +-292 years, as `Duration` is.
[[nodiscard]] constexpr Duration from_seconds(double seconds) noexcept {
  constexpr double kNanosecondsPerSecond = 1e9;
  const double ns = seconds * kNanosecondsPerSecond;
  return Duration{static_cast<std::int64_t>(ns < 0.0 ? ns - 0.5 : ns + 0.5)};
}

}  // namespace geoflow
