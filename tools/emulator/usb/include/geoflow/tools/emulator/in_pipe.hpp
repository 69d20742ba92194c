#pragma once

#include <cstddef>
#include <cstdint>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// One IN endpoint as a host controller reads it: the device's transfers, cut to the requests of
/// the host. A request ends when it is full or with the transfer's last, short packet; after a
/// transfer that ends just where a request is full, the next request gets the empty packet.
/// Thread-bound, as the device.
class InPipe {
 public:
  /// `endpoint`: address with the direction bit. The device must outlive this.
  InPipe(UsbDevice& device, std::uint8_t endpoint) noexcept
      : device_{device}, endpoint_{endpoint} {}

  /// What a request for at most `length` bytes (> 0) gets now; kNothing: it stays open.
  [[nodiscard]] InTransfer read(std::size_t length, HostTime now);

  /// Forgets the rest of a transfer under way (after CLEAR_FEATURE(ENDPOINT_HALT), a reset).
  void clear() noexcept;

 private:
  UsbDevice& device_;
  std::uint8_t endpoint_;
  Bytes transfer_;
  std::size_t sent_ = 0;
  bool under_way_ = false;
};

}  // namespace geoflow::emulator
