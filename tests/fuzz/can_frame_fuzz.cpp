#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>

#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/snapshot.hpp"

// Any frames at any times: what comes out is finite, in order, and accounted for.

namespace can = geoflow::drivers::can;

namespace {

constexpr std::size_t kRecord = 14;  // 2 bytes identifier, 2 delay, 1 flags, 1 length, 8 data

can::Frame frame_from(std::span<const std::uint8_t, kRecord> bytes) {
  can::Frame frame{.id = static_cast<std::uint32_t>(bytes[0] | (bytes[1] & 7U) << 8U),
                   .extended = (bytes[4] & 1U) != 0,
                   .remote = (bytes[4] & 2U) != 0,
                   .error = (bytes[4] & 4U) != 0,
                   .fd = (bytes[4] & 8U) != 0};
  frame.length = static_cast<std::uint8_t>(bytes[5] % (frame.fd ? 65U : 9U));
  std::memcpy(frame.data.data(), &bytes[6], std::min<std::size_t>(frame.length, 8));
  return frame;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const can::LegDictionary dictionary = can::LegDictionary::load({}).value();
  can::SnapshotAssembler assembler{dictionary};
  geoflow::HostTime now{std::chrono::seconds{100}};
  std::uint64_t snapshots = 0;
  const auto take = [&] {
    while (const auto snapshot = assembler.pop(now)) {
      ++snapshots;
      const auto t = snapshot->t_device.time_since_epoch();
      if (t < geoflow::Duration::zero() || t >= *assembler.stamps().wrap ||
          snapshot->t_arrival > now) {
        std::abort();
      }
      for (const auto& joint : snapshot->sample.joints) {
        if (!std::isfinite(joint.q_rad) || !std::isfinite(joint.dq_radps)) {
          std::abort();
        }
      }
    }
  };
  for (std::span rest{data, size}; rest.size() >= kRecord; rest = rest.subspan(kRecord)) {
    const auto record = rest.first<kRecord>();
    now += std::chrono::microseconds{record[2] | record[3] << 8U};
    (void)assembler.push({.frame = frame_from(record), .t_arrival = now});
    take();
  }
  assembler.finish();
  take();
  if (snapshots != assembler.counters().snapshots) {
    std::abort();
  }
  return 0;
}
