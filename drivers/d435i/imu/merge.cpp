#include "d435i/imu/merge.hpp"

#include <chrono>
#include <cstdint>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::d435i {
namespace {

/// a - b on a clock of 32 bits, for times less than half its period apart.
std::int32_t elapsed_us(std::uint32_t a, std::uint32_t b) noexcept {
  return static_cast<std::int32_t>(a - b);
}

}  // namespace

void ImuMerge::add_accel(const StampedVector& accel) noexcept {
  if (accels_.size() > 0 && elapsed_us(accel.t_us, accels_.back().t_us) <= 0) {
    // A clock that went back a little is a sample out of order; far, it has begun anew.
    if (elapsed_us(accels_.back().t_us, accel.t_us) <= kWidestGap_us) {
      ++lost_;
      return;
    }
    accels_.clear();
  }
  if (accels_.full()) {
    accels_.pop_front();
  }
  accels_.push(accel);
}

void ImuMerge::add_gyro(const StampedVector& gyro) noexcept {
  if (gyros_.full()) {
    gyros_.pop_front();
    ++lost_;
  }
  gyros_.push(gyro);
}

std::optional<Vector3d> ImuMerge::acceleration_at(const StampedVector& gyro) const noexcept {
  if (accels_.size() < 2) {
    return std::nullopt;
  }
  const StampedVector& before = accels_[0];
  const StampedVector& after = accels_[1];
  const std::int32_t to_after = elapsed_us(after.t_us, gyro.t_us);
  const std::int32_t gap = elapsed_us(after.t_us, before.t_us);
  if (to_after < 0 || gap > kWidestGap_us || to_after > gap) {
    return std::nullopt;
  }
  const double ratio = 1 - static_cast<double>(to_after) / gap;
  return before.value + ratio * (after.value - before.value);
}

std::optional<Arrival<ImuClock, ImuSample>> ImuMerge::pop() noexcept {
  while (gyros_.size() > 0 && accels_.size() > 0) {
    const StampedVector gyro = gyros_[0];
    while (accels_.size() > 1 && elapsed_us(accels_[1].t_us, gyro.t_us) < 0) {
      accels_.pop_front();
    }
    const std::int32_t ahead = elapsed_us(gyro.t_us, accels_.back().t_us);
    if (ahead > 0 && ahead <= kWidestGap_us) {
      return std::nullopt;  // the acceleration after it is to come
    }
    gyros_.pop_front();
    if (const auto accel_mps2 = acceleration_at(gyro)) {
      return Arrival<ImuClock, ImuSample>{
          .t_device = DeviceTime<ImuClock>{std::chrono::microseconds{gyro.t_us}},
          .t_arrival = gyro.t_arrival,
          .sample = {.accel_mps2 = *accel_mps2, .gyro_radps = gyro.value}};
    }
    ++lost_;
  }
  return std::nullopt;
}

}  // namespace geoflow::drivers::d435i
