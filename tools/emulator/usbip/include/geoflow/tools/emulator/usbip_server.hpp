#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// Plugs one emulated device into a Linux kernel by USB/IP: this machine's (through vhci-hcd), or
/// that of whoever connects (`usbip attach -r 127.0.0.1 -b 1-1`). A device that leaves the bus is
/// unplugged, and plugged in again when it is back. Thread-bound.
class UsbIpServer {
 public:
  /// The bus id under which it is offered.
  static constexpr const char* kBusId = "1-1";

  /// Offers `device` on 127.0.0.1; port 0: one that is free. The device must outlive the server.
  /// Errors: the port is taken.
  [[nodiscard]] static Result<std::unique_ptr<UsbIpServer>> listen(UsbDevice& device,
                                                                   std::uint16_t port);
  /// Plugs `device` into this machine. Errors say what is missing: the module vhci-hcd, permission,
  /// a free port.
  [[nodiscard]] static Result<std::unique_ptr<UsbIpServer>> attach(UsbDevice& device);

  UsbIpServer(const UsbIpServer&) = delete;
  UsbIpServer& operator=(const UsbIpServer&) = delete;
  virtual ~UsbIpServer() = default;

  /// The port it listens on; 0 where it does not.
  [[nodiscard]] virtual std::uint16_t port() const = 0;
  /// Whether a kernel has the device.
  [[nodiscard]] virtual bool attached() const = 0;
  /// Waits until there is something to do, but not longer than `at_most`, and does it. Ends early
  /// when a signal comes. Errors are those that leave no way to go on.
  [[nodiscard]] virtual Result<void> serve(Duration at_most) = 0;

 protected:
  UsbIpServer() = default;
};

}  // namespace geoflow::emulator
