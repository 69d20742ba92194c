#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// Requests and replies of the hardware monitor have this size on the wire.
inline constexpr std::size_t kMonitorSize = 1024;

/// The hardware monitor behind extension unit 3, selector 1: a request is set, its reply is
/// fetched. Source: librealsense's hw-monitor and ds-private.h. What a D435i can do and nobody
/// needs to see a recording is answered with -1 (no such command).
class HardwareMonitor {
 public:
  HardwareMonitor(const D435iOptions& options, const Calibration& calibration);

  /// Takes a request of kMonitorSize bytes; `device_us` is the device clock.
  void request(std::span<const std::byte> bytes, std::uint64_t device_us);
  /// The reply to the last request, kMonitorSize bytes: opcode or negative error, data, and the
  /// data's length in the last four.
  [[nodiscard]] const Bytes& reply() const noexcept { return reply_; }
  /// Whether the last request was to restart the camera; asked once.
  [[nodiscard]] bool take_restart() noexcept;

 private:
  struct Command;
  /// Data, or a negative error.
  struct Answer {
    std::int32_t error = 0;
    Bytes data{};
  };
  [[nodiscard]] Answer answer(const Command& command, std::uint64_t device_us);
  [[nodiscard]] Answer table(std::uint32_t id) const;
  [[nodiscard]] Answer motion_memory(std::uint32_t offset, std::uint32_t size) const;
  [[nodiscard]] Answer advanced(std::uint32_t group, std::uint32_t mode) const;

  /// top, bottom, left, right [px] of the region that decides exposure.
  using Region = std::array<std::uint16_t, 4>;

  D435iOptions options_;
  Calibration calibration_;
  bool advanced_;
  std::uint32_t synchronisation_ = 0;
  Region depth_region_{};
  Region color_region_{};
  bool restart_ = false;
  Bytes reply_;
};

/// The camera's identity (GVD).
[[nodiscard]] Bytes identity(const D435iOptions& options);

}  // namespace geoflow::emulator
