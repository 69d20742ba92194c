#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/time.hpp"

/// Devices that exist in software only, seen from their USB plug. What carries the transfers
/// (USB/IP, or a test in the same process) is no concern of theirs.
namespace geoflow::emulator {

using Bytes = std::vector<std::byte>;

/// The eight bytes that open a control transfer (USB 3.2, table 9-3).
struct SetupPacket {
  std::uint8_t request_type = 0;  ///< direction, type and recipient
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;  ///< of the data stage [bytes]

  [[nodiscard]] constexpr bool is_in() const noexcept {
    constexpr std::uint8_t kDeviceToHost = 0x80;
    return (request_type & kDeviceToHost) != 0;
  }
};

/// Speeds as Linux numbers them (enum usb_device_speed).
enum class UsbSpeed : std::uint8_t { kHigh = 3, kSuper = 5 };

/// What an endpoint says when it is asked for data.
enum class InStatus : std::uint8_t {
  kNothing,  ///< not now (NAK, NRDY)
  kData,
  kStall,  ///< halted, until CLEAR_FEATURE(ENDPOINT_HALT)
  kBroken  ///< this transfer failed on the wire (EPROTO); the next one may do better
};

/// One whole transfer: on a bulk endpoint all bytes up to the short packet that ends it, on an
/// interrupt endpoint one report.
struct InTransfer {
  InStatus status = InStatus::kNothing;
  Bytes data{};
};

/// One device. It owns no thread and reads no clock: `now` never decreases from call to call.
/// Thread-bound.
class UsbDevice {
 public:
  UsbDevice() = default;
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;
  virtual ~UsbDevice() = default;

  [[nodiscard]] virtual UsbSpeed speed() const = 0;

  /// Answers a control transfer. `out` is the data stage of a transfer to the device, empty
  /// otherwise. Returns the data stage of a transfer to the host, not longer than `setup.length`,
  /// and nothing in it of one to the device. None: STALL.
  [[nodiscard]] virtual std::optional<Bytes> control(const SetupPacket& setup,
                                                     std::span<const std::byte> out,
                                                     HostTime now) = 0;

  /// Takes the next transfer of an IN endpoint (address with its direction bit, 0x82).
  [[nodiscard]] virtual InTransfer next_in(std::uint8_t endpoint, HostTime now) = 0;

  /// When next_in() of that endpoint may first have more to say than it had at `now`;
  /// HostTime::max() where only a control transfer can bring that about. While the device is off
  /// the bus: when it comes back.
  [[nodiscard]] virtual HostTime next_due(std::uint8_t endpoint, HostTime now) = 0;

  /// False while the device is off the bus (unplugged, or restarting). It comes back with all state
  /// lost.
  [[nodiscard]] virtual bool connected(HostTime now) = 0;

  /// The host resets the port: not configured, nothing streams. What a real device keeps over a
  /// reset is kept.
  virtual void reset(HostTime now) = 0;
};

}  // namespace geoflow::emulator
