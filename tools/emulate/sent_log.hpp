#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <span>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::tools {

/// Writes down what a device sends, so that what a host received can be compared: one JSON object a
/// line for each transfer of an IN endpoint, with `endpoint`, `size` [bytes], `t_ns`
/// (CLOCK_MONOTONIC), and `report` in hexadecimal (interrupt endpoints), or `header`, as long as
/// the payload's first byte says, in hexadecimal and `crc32` of what follows it.
class SentLog final : public emulator::UsbDevice {
 public:
  /// `device` must outlive this.
  [[nodiscard]] static Result<std::unique_ptr<SentLog>> open(emulator::UsbDevice& device,
                                                             const std::filesystem::path& path);

  [[nodiscard]] emulator::UsbSpeed speed() const override { return device_.speed(); }
  [[nodiscard]] std::optional<emulator::Bytes> control(const emulator::SetupPacket& setup,
                                                       std::span<const std::byte> out,
                                                       HostTime now) override {
    return device_.control(setup, out, now);
  }
  [[nodiscard]] emulator::InTransfer next_in(std::uint8_t endpoint, HostTime now) override;
  [[nodiscard]] HostTime next_due(std::uint8_t endpoint, HostTime now) override {
    return device_.next_due(endpoint, now);
  }
  [[nodiscard]] bool connected(HostTime now) override { return device_.connected(now); }
  void reset(HostTime now) override { device_.reset(now); }

 private:
  SentLog(emulator::UsbDevice& device, std::ofstream file)
      : device_{device}, file_{std::move(file)} {}

  emulator::UsbDevice& device_;
  std::ofstream file_;
};

}  // namespace geoflow::tools
