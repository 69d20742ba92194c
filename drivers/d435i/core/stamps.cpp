#include "d435i/core/stamps.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "geoflow/hal/time.hpp"

#include "d435i/uvc/metadata.hpp"
#include "d435i/uvc/payload.hpp"

namespace geoflow::drivers::d435i {
namespace {

// No exposure's middle is further from its frame's stamp: a slow one of 6 Hz has 83 ms.
constexpr std::uint32_t kLargestOpticalTime_us = 200'000;

}  // namespace

std::optional<FrameStamp> read_frame_stamp(std::span<const std::byte> bytes) {
  if (bytes.empty()) {
    return std::nullopt;
  }
  const auto header = parse_payload_header(bytes);
  if (!header || !header->pts_us) {
    return std::nullopt;
  }
  const auto metadata = parse_metadata(header->metadata);
  if (!metadata || !metadata->timing) {
    return FrameStamp{.t_us = *header->pts_us};
  }
  const std::uint32_t optical_us = metadata->timing->optical_time_us.value_or(0);
  return FrameStamp{
      .t_us = *header->pts_us - (optical_us <= kLargestOpticalTime_us ? optical_us : 0),
      .counter = metadata->timing->frame_counter};
}

std::uint32_t StampSource::stamp(std::optional<std::uint32_t> device_us,
                                 HostTime t_arrival) noexcept {
  if (device_us) {
    device_us_ = *device_us;
    t_arrival_ = t_arrival;
    return *device_us;
  }
  ++by_arrival_;
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(t_arrival - t_arrival_);
  return device_us_ +
         static_cast<std::uint32_t>(since.count());  // modulo 2^32, as the camera counts
}

}  // namespace geoflow::drivers::d435i
