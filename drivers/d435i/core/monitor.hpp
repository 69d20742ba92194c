#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/monitor/command.hpp"

namespace geoflow::drivers::d435i {

/// Selectors of the depth function's extension unit (librealsense, src/ds/ds-private.h).
inline constexpr std::uint8_t kMonitorSelector = 1;
inline constexpr std::uint8_t kEmitterSelector = 2;        ///< u8: 0 off, 1 on, 2 auto
inline constexpr std::uint8_t kExposureSelector = 3;       ///< u32 [us]
inline constexpr std::uint8_t kLaserPowerSelector = 4;     ///< u16, 0 to 360 in steps of 30 [mW]
inline constexpr std::uint8_t kAutoExposureSelector = 11;  ///< u8

/// Sends a command and reads its answer. While the firmware is not ready it is asked again each
/// 10 ms, for a second at most; samples that come meanwhile are dropped. Errors as parse_reply(),
/// and the transport's.
[[nodiscard]] Result<std::vector<std::byte>> ask_monitor(Transport& transport,
                                                         const MonitorCommand& command);

/// Sends Opcode::kHardwareReset, which has no answer.
[[nodiscard]] Result<void> send_hardware_reset(Transport& transport);

}  // namespace geoflow::drivers::d435i
