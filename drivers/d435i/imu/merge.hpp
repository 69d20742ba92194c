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
/// stamps, the acceleration interpolated linearly between its neighbours. Each may come ahead of
/// the other by kWaiting values, as where both are read in batches; a gyroscope's value waits for
/// the acceleration after it. Where accelerations lie more than kWidestGap_us apart there is no
/// sample. Thread-bound, no allocation.
class ImuMerge {
 public:
  static constexpr std::int32_t kWidestGap_us = 100'000;
  static constexpr std::size_t kWaiting = 64;

  void add_accel(const StampedVector& accel) noexcept;
  void add_gyro(const StampedVector& gyro) noexcept;

  /// The next complete sample, in order of time.
  [[nodiscard]] std::optional<Arrival<ImuClock, ImuSample>> pop() noexcept;

  /// Gyroscope values that got no acceleration, and values that came out of order.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

 private:
  /// The newest kWaiting values, oldest first.
  class Ring {
   public:
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool full() const noexcept { return size_ == kWaiting; }
    [[nodiscard]] const StampedVector& operator[](std::size_t i) const noexcept {
      return values_.at((first_ + i) % kWaiting);
    }
    [[nodiscard]] const StampedVector& back() const noexcept { return (*this)[size_ - 1]; }
    /// There is room: it is not full.
    void push(const StampedVector& value) noexcept {
      values_.at((first_ + size_) % kWaiting) = value;
      ++size_;
    }
    /// There is one.
    void pop_front() noexcept {
      first_ = (first_ + 1) % kWaiting;
      --size_;
    }
    void clear() noexcept { size_ = 0; }

   private:
    std::array<StampedVector, kWaiting> values_{};
    std::size_t first_ = 0;
    std::size_t size_ = 0;
  };

  /// Between the first two accelerations; none where they are not around it, or too far apart.
  [[nodiscard]] std::optional<Vector3d> acceleration_at(const StampedVector& gyro) const noexcept;

  Ring accels_;
  Ring gyros_;
  std::uint64_t lost_ = 0;
};

}  // namespace geoflow::drivers::d435i
