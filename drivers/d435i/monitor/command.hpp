#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

/// The hardware monitor: commands to the camera's firmware through selector 1 of the depth
/// function's extension unit, always 1024 bytes there and back.
///
/// Source: librealsense, src/hw-monitor.cpp and src/ds/ds-private.h.
namespace geoflow::drivers::d435i {

inline constexpr std::size_t kMonitorBytes = 1024;

enum class Opcode : std::uint32_t {
  kReadMemory = 0x01,            ///< from address p1 up to p2
  kVersions = 0x10,              ///< GVD: see parse_versions()
  kCalibrationTable = 0x15,      ///< of the id p1
  kHardwareReset = 0x20,         ///< no reply: the camera leaves the bus
  kAdvancedParameters = 0x2c,    ///< of the group p1; p2: 0 value, 1 least, 2 largest
  kAdvancedMode = 0x30,          ///< one byte: whether it is on
  kImuCalibration = 0x4f,        ///< from offset p1, p2 bytes
  kResolutionIntrinsics = 0x7e,  ///< a list of depth intrinsics by resolution
};

/// Calibration tables by their id.
inline constexpr std::uint32_t kCoefficientsTable = 25;
inline constexpr std::uint32_t kColorTable = 32;

struct MonitorCommand {
  Opcode opcode{};
  std::array<std::uint32_t, 4> parameters{};
  std::span<const std::byte> data{};  ///< at most 1000 bytes; the rest is left out
};

/// The 1024 bytes of a command.
[[nodiscard]] std::vector<std::byte> encode_command(const MonitorCommand& command);

/// The data of a reply to `opcode`: a view into `reply`. kUnavailable where the firmware is not
/// ready or busy, kNotFound where it has nothing to return, kUnsupported where it does not know the
/// command, else kInvalidData; each with the firmware's error in words. Pure.
[[nodiscard]] Result<std::span<const std::byte>> parse_reply(std::span<const std::byte> reply,
                                                             Opcode opcode);

/// Reads the camera's microsecond counter: the clock of all its stamps.
[[nodiscard]] std::vector<std::byte> encode_clock_command();
[[nodiscard]] Result<std::uint32_t> parse_clock_us(std::span<const std::byte> data);

}  // namespace geoflow::drivers::d435i
