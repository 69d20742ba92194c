#include "d435i/imu/merge.hpp"

#include <chrono>
#include <cstddef>
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
  if (after_ && elapsed_us(accel.t_us, after_->t_us) <= 0) {
    // A clock that went back a little is a sample out of order; far, it has begun anew.
    if (elapsed_us(after_->t_us, accel.t_us) <= kWidestGap_us) {
      ++lost_;
      return;
    }
    after_.reset();
  }
  before_ = after_;
  after_ = accel;
}

void ImuMerge::add_gyro(const StampedVector& gyro) noexcept {
  if (count_ == kWaiting) {
    drop_first();
  }
  waiting_.at((first_ + count_) % kWaiting) = gyro;
  ++count_;
}

void ImuMerge::drop_first() noexcept {
  first_ = (first_ + 1) % kWaiting;
  --count_;
  ++lost_;
}

std::optional<Arrival<ImuClock, ImuSample>> ImuMerge::pop() noexcept {
  while (count_ > 0 && after_) {
    const StampedVector& gyro = waiting_.at(first_);
    const std::int32_t to_after = elapsed_us(after_->t_us, gyro.t_us);
    if (to_after < 0 && -to_after <= kWidestGap_us) {
      return std::nullopt;  // the acceleration after it is to come
    }
    const std::int32_t gap = before_ ? elapsed_us(after_->t_us, before_->t_us) : 0;
    if (to_after < 0 || gap <= 0 || gap > kWidestGap_us || to_after > gap) {
      drop_first();
      continue;
    }
    const double ratio = 1 - static_cast<double>(to_after) / gap;
    const Vector3d accel_mps2 = before_->value + ratio * (after_->value - before_->value);
    const Arrival<ImuClock, ImuSample> sample{
        .t_device = DeviceTime<ImuClock>{std::chrono::microseconds{gyro.t_us}},
        .t_arrival = gyro.t_arrival,
        .sample = {.accel_mps2 = accel_mps2, .gyro_radps = gyro.value}};
    first_ = (first_ + 1) % kWaiting;
    --count_;
    return sample;
  }
  return std::nullopt;
}

}  // namespace geoflow::drivers::d435i
