#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// One open USB device, seen from the host: what drivers need of it, whatever carries the
/// transfers.
namespace geoflow::drivers::usb {

struct DeviceInfo {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string place;   ///< bus and ports, as in sysfs: "2-1.4"
  std::string serial;  ///< iSerial; empty: it has none, or may not be asked
  bool super_speed = false;
};

/// The first part of a control transfer's setup packet (USB 3.2, table 9-3); its length is that of
/// the data.
struct ControlRequest {
  std::uint8_t type = 0;  ///< bmRequestType, with its direction
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
};

enum class TransferStatus : std::uint8_t {
  kCompleted,
  kStalled,  ///< the endpoint is halted: nothing more comes until clear_halt()
  kFailed,   ///< this transfer failed on the wire; the next one may do better
};

/// Gets IN transfers, on the thread that polls. `data` is borrowed for the time of the call.
class InSink {
 public:
  InSink() = default;
  InSink(const InSink&) = delete;
  InSink& operator=(const InSink&) = delete;
  virtual ~InSink() = default;
  virtual void on_transfer(std::uint8_t endpoint, TransferStatus status,
                           std::span<const std::byte> data, HostTime t_arrival) = 0;
};

/// How an IN endpoint is read.
struct InPipe {
  std::uint8_t endpoint = 0;       ///< with its direction bit: 0x82
  bool interrupt = false;          ///< else bulk
  std::size_t transfer_bytes = 0;  ///< a multiple of the endpoint's packet
  int transfers = 0;               ///< kept waiting at the host controller
};

/// Thread-bound. Errors: kNotFound, the device is gone; kUnavailable, it stalled the request, timed
/// out or is in use; kSystem, the system refused. A control transfer takes half a second at most.
class Port {
 public:
  Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;
  virtual ~Port() = default;

  [[nodiscard]] virtual const DeviceInfo& info() const = 0;
  /// The whole descriptor of the active configuration.
  [[nodiscard]] virtual Result<std::vector<std::byte>> configuration() = 0;
  /// Takes an interface, from a kernel driver if one has it.
  [[nodiscard]] virtual Result<void> claim(std::uint8_t interface) = 0;

  /// The number of bytes that came.
  [[nodiscard]] virtual Result<std::size_t> control_in(const ControlRequest& request,
                                                       std::span<std::byte> data) = 0;
  [[nodiscard]] virtual Result<void> control_out(const ControlRequest& request,
                                                 std::span<const std::byte> data) = 0;
  [[nodiscard]] virtual Result<void> clear_halt(std::uint8_t endpoint) = 0;

  [[nodiscard]] virtual Result<void> start_in(const InPipe& pipe) = 0;
  /// Harmless when it is not read.
  virtual void stop_in(std::uint8_t endpoint) = 0;
  /// Waits for transfers, at most `timeout`, and hands them on. kNotFound: the device is gone.
  [[nodiscard]] virtual Result<void> poll(Duration timeout, InSink& sink) = 0;

  /// Resets the device's port. It may come back under another address.
  [[nodiscard]] virtual Result<void> reset() = 0;
};

}  // namespace geoflow::drivers::usb
