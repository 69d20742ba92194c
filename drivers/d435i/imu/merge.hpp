#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::d435i {

/// One sensor's value with its stamp on the camera's 32-bit clock.
struct StampedVector {
  std::uint32_t t_us = 0;
  HostTime t_arrival;
  Vector3d value = Vector3d::Zero();
};

/// Makes one IMU of an accelerometer and a gyroscope that report apart: samples at the gyroscope's
/// stamps, the acceleration interpolated linearly between its neighbours. A gyroscope's value waits
/// for the acceleration after it, at most kWaiting of them. Where accelerations lie more than
/// kWidestGap apart there is no sample. Thread-bound, no allocation.
class ImuMerge {
 public:
  static constexpr std::int32_t kWidestGap_us = 100'000;
  static constexpr std::size_t kWaiting = 32;

  void add_accel(const StampedVector& accel) noexcept;
  void add_gyro(const StampedVector& gyro) noexcept;

  /// The next complete sample, in order of time.
  [[nodiscard]] std::optional<Arrival<ImuClock, ImuSample>> pop() noexcept;

  /// Gyroscope values that got no acceleration, and values that came out of order.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

 private:
  void drop_first() noexcept;

  std::optional<StampedVector> before_;
  std::optional<StampedVector> after_;
  std::array<StampedVector, kWaiting> waiting_{};  // a ring
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace geoflow::drivers::d435i
