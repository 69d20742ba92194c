#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "geoflow/hal/time.hpp"

#include "dds/low_state.hpp"
#include "dds/message_filter.hpp"
#include "reasoned.hpp"

// Any bytes as a robot's message: read or refused with a reason; what is read is written back as it
// was, and only numbers come out as samples.

namespace dds = geoflow::drivers::dds;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  const auto state = dds::decode(bytes);
  geoflow::tests::require_reason(state);
  if (state) {
    const auto again = dds::decode(dds::encode(*state));
    if (!again || dds::memory_image(*again) != dds::memory_image(*state)) {
      std::abort();
    }
  }
  dds::MessageFilter filter{"test"};
  geoflow::HostTime now{std::chrono::seconds{1}};
  filter.opened(now);
  for (int i = 0; i < 2; ++i) {
    now += std::chrono::milliseconds{2};
    if (const auto sample = filter.take(bytes, now)) {
      for (const auto& joint : sample->legs.sample.joints) {
        if (!std::isfinite(joint.q_rad) || !std::isfinite(joint.dq_radps)) {
          std::abort();
        }
      }
      if (!sample->imu.sample.gyro_radps.allFinite()) {
        std::abort();
      }
    }
  }
  if (filter.counters().accepted > 1) {
    std::abort();  // the second is a duplicate
  }
  return 0;
}
