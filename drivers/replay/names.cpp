#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <variant>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers {

std::string_view name(FaultKind kind) noexcept {
  constexpr std::array<std::string_view, kFaultKindCount> kNames = {
      "drop",         "delay",       "duplicate",  "reorder",    "stuck",    "nan",  "gap",
      "clock_offset", "clock_drift", "clock_jump", "clock_wrap", "truncate", "cover"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view name(StreamId stream) noexcept {
  constexpr std::array<std::string_view, kStreamCount> kNames = {"color", "depth", "imu", "legs",
                                                                 "body_velocity"};
  return kNames[static_cast<std::size_t>(stream)];
}

bool RecordingInfo::has(StreamId stream) const noexcept {
  return std::ranges::any_of(streams, [stream](const StreamSummary& summary) {
    return summary.stream == stream && summary.count > 0;
  });
}

StreamId stream_of(const Event& event) noexcept {
  constexpr std::array<StreamId, std::variant_size_v<Event>> kStreams = {
      StreamId::kColor, StreamId::kImu, StreamId::kLegs, StreamId::kBodyVelocity};
  const auto* image = std::get_if<Arrival<CameraClock, EncodedImage>>(&event);
  if (image != nullptr && image->sample.stream == ImageStream::kDepth) {
    return StreamId::kDepth;
  }
  return kStreams[event.index()];
}

HostTime arrival_of(const Event& event) {
  return std::visit([](const auto& sample) { return sample.t_arrival; }, event);
}

}  // namespace geoflow::drivers
