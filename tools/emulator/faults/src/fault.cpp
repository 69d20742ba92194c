#include "geoflow/tools/emulator/fault.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::emulator {
namespace {

constexpr double kLongestS = 1e6;

struct StreamName {
  std::string_view name;
  std::uint8_t endpoint;
};
constexpr std::array<StreamName, 4> kStreams{
    {{"depth", 0x82}, {"infrared", 0x83}, {"color", 0x84}, {"imu", 0x86}}};

/// The part behind the last `mark`, which is cut off with it; empty where there is none.
std::string_view cut_behind(std::string_view& text, char mark) {
  const std::size_t at = text.rfind(mark);
  if (at == std::string_view::npos) {
    return {};
  }
  const std::string_view behind = text.substr(at + 1);
  text = text.substr(0, at);
  return behind;
}

Result<Duration> seconds(std::string_view text, std::string_view whole) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !(value >= 0.0) ||
      value > kLongestS) {
    return fail(ErrorCode::kInvalidArgument, "fault '{}': '{}' is no time from 0 to {} s", whole,
                text, kLongestS);
  }
  return from_seconds(value);
}

template <typename Names>
std::string all_of(const Names& names) {
  std::string all;
  for (const auto& entry : names) {
    all += all.empty() ? "" : ", ";
    all += entry.name;
  }
  return all;
}

}  // namespace

const std::vector<FaultName>& fault_names() {
  static const std::vector<FaultName> kNames{
      {"unplug", DeviceFault::kUnplug, "off the bus"},
      {"stall", DeviceFault::kStall, "the endpoint halts, once, until the host clears it"},
      {"broken", DeviceFault::kBroken, "transfers fail on the wire"},
      {"silent", DeviceFault::kSilent, "nothing is sent"},
      {"frozen", DeviceFault::kFrozen, "frames go on, their image does not"},
      {"short", DeviceFault::kShort, "half of each frame or report"},
      {"corrupt", DeviceFault::kCorrupt, "the middle third of each image is inverted"},
      {"bad-header", DeviceFault::kBadHeader, "payload headers of one byte"},
      {"error-bit", DeviceFault::kErrorBit, "payload headers say that the frame is bad"},
      {"no-metadata", DeviceFault::kNoMetadata, "payload headers of the standard's 12 bytes"},
      {"other-layout", DeviceFault::kOtherLayout, "IMU reports of the other firmware's length"}};
  return kNames;
}

Result<TimedFault> parse_fault(std::string_view text) {
  TimedFault fault{.duration = std::chrono::seconds{1}};
  std::string_view rest = text;
  const std::string_view stream = cut_behind(rest, ':');
  const std::string_view times = cut_behind(rest, '@');
  std::string_view start = times;
  const std::string_view duration = cut_behind(start, '+');
  const auto& names = fault_names();
  const auto name = std::find_if(names.begin(), names.end(),
                                 [&](const FaultName& entry) { return entry.name == rest; });
  if (name == names.end()) {
    return fail(ErrorCode::kInvalidArgument, "fault '{}': there is no '{}'; there are {}", text,
                rest, all_of(names));
  }
  fault.fault = name->fault;
  const auto begins = seconds(start, text);
  const auto lasts = duration.empty() ? Result<Duration>{fault.duration} : seconds(duration, text);
  if (!begins || !lasts) {
    return tl::unexpected{begins ? lasts.error() : begins.error()};
  }
  fault.start = *begins;
  fault.duration = *lasts;
  if (!stream.empty()) {
    const auto* const found = std::find_if(kStreams.begin(), kStreams.end(),
                                           [&](const auto& entry) { return entry.name == stream; });
    if (found == kStreams.end()) {
      return fail(ErrorCode::kInvalidArgument, "fault '{}': there is no stream '{}'; there are {}",
                  text, stream, all_of(kStreams));
    }
    fault.endpoint = found->endpoint;
  }
  return fault;
}

}  // namespace geoflow::emulator
