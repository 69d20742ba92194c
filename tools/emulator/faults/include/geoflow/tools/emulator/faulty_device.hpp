#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/fault.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// A camera on whose way to the host something goes wrong. Transfers with bulk endpoints are taken
/// for UVC payloads, those of the interrupt endpoint 0x86 for IMU reports.
class FaultyDevice final : public UsbDevice {
 public:
  /// `device` must outlive this.
  FaultyDevice(UsbDevice& device, std::vector<TimedFault> faults);

  [[nodiscard]] UsbSpeed speed() const override { return device_.speed(); }
  [[nodiscard]] std::optional<Bytes> control(const SetupPacket& setup,
                                             std::span<const std::byte> out, HostTime now) override;
  [[nodiscard]] InTransfer next_in(std::uint8_t endpoint, HostTime now) override;
  [[nodiscard]] HostTime next_due(std::uint8_t endpoint, HostTime now) override;
  [[nodiscard]] bool connected(HostTime now) override;
  void reset(HostTime now) override;

 private:
  [[nodiscard]] bool active(DeviceFault fault, std::uint8_t endpoint, HostTime now) const;
  /// The index of a stall that is to begin by now and did not yet.
  [[nodiscard]] std::optional<std::size_t> new_stall(std::uint8_t endpoint, HostTime now) const;
  void spoil(std::uint8_t endpoint, Bytes& data, HostTime now);

  UsbDevice& device_;
  std::vector<TimedFault> faults_;
  std::optional<HostTime> epoch_;         ///< first transfer
  std::set<std::size_t> stalled_;         ///< faults that happened
  std::set<std::uint8_t> halted_;         ///< endpoints
  std::map<std::uint8_t, Bytes> frozen_;  ///< their image
};

}  // namespace geoflow::emulator
