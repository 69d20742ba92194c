#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::d435i {

/// The camera's counter of microseconds has 32 bits: 71 min 35 s.
inline constexpr Duration kClockWrap = std::chrono::microseconds{std::int64_t{1} << 32U};

/// A count of that counter as a device's time.
template <typename Clock>
[[nodiscard]] DeviceTime<Clock> device_time(std::uint32_t count_us) noexcept {
  return DeviceTime<Clock>{std::chrono::microseconds{count_us}};
}

/// What a frame's header says of its time.
struct FrameStamp {
  std::uint32_t t_us = 0;  ///< the middle of the exposure where the metadata tells it, else its end
  std::optional<std::uint32_t> counter{};  ///< of the camera's frames; none: not in the header
};

/// None where the header, which may be empty, has no stamp or is damaged. Pure.
[[nodiscard]] std::optional<FrameStamp> read_frame_stamp(std::span<const std::byte> header);

/// Stamps of one stream, by the device where a sample carries its stamp. One that does not gets the
/// stamp that its arrival asks for, going by the newest sample that did; before there is one, the
/// host's own microseconds stand in, so that a stream without any stamps is stamped by arrival.
/// Thread-bound.
class StampSource {
 public:
  /// The stamp [us] of a sample: `device_us` if there is one.
  [[nodiscard]] std::uint32_t stamp(std::optional<std::uint32_t> device_us,
                                    HostTime t_arrival) noexcept;

  /// Samples that had to be stamped by their arrival.
  [[nodiscard]] std::uint64_t by_arrival() const noexcept { return by_arrival_; }

 private:
  std::uint32_t device_us_ = 0;
  HostTime t_arrival_{};
  std::uint64_t by_arrival_ = 0;
};

}  // namespace geoflow::drivers::d435i
