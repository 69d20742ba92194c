#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::emulator {

enum class DeviceFault : std::uint8_t {
  kUnplug,      ///< off the bus
  kStall,       ///< the endpoint halts, once, until the host clears it
  kBroken,      ///< transfers fail on the wire
  kSilent,      ///< nothing is sent
  kFrozen,      ///< frames go on, their image does not
  kShort,       ///< half of each frame or report
  kCorrupt,     ///< the middle third of each image is inverted
  kBadHeader,   ///< payload headers of one byte
  kErrorBit,    ///< payload headers say that the frame is bad
  kNoMetadata,  ///< payload headers without what follows the standard's 12 bytes
  kOtherLayout  ///< IMU reports of the other firmware's length
};

/// A fault of a D435i and when it is there: from `start` on for `duration`, counted from the first
/// frame or report that was sent.
struct TimedFault {
  DeviceFault fault = DeviceFault::kUnplug;
  Duration start{};
  Duration duration{};
  std::optional<std::uint8_t> endpoint{};  ///< none: all to which it can happen
};

/// Reads `FAULT@START[+DURATION][:STREAM]`, times in seconds: "silent@5+2:depth". Without a
/// duration: one second. Streams: depth, infrared, color, imu. Errors name the part that is wrong,
/// and what there is instead.
[[nodiscard]] Result<TimedFault> parse_fault(std::string_view text);

/// Name and meaning of each fault, as `parse_fault` takes it.
struct FaultName {
  std::string_view name;
  DeviceFault fault;
  std::string_view summary;
};
[[nodiscard]] const std::vector<FaultName>& fault_names();

}  // namespace geoflow::emulator
