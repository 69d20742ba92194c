#include "d435i/core/stamps.hpp"

#include <chrono>
#include <cstdint>
#include <optional>

#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::d435i {

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
