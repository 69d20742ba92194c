#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/in_pipe.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/messages.hpp"

namespace geoflow::emulator::usbip {

/// An attached device's half of a USB/IP connection, without the connection: bytes in, bytes out.
/// Thread-bound.
class Session {
 public:
  /// The device is reset, as by the port that it is plugged into, and must outlive this.
  Session(UsbDevice& device, HostTime now);

  /// Takes what the host sent. An Error: the host does not speak USB/IP, and the connection is of
  /// no more use.
  [[nodiscard]] Result<void> feed(std::span<const std::byte> bytes, HostTime now);
  /// Answers those requests for data that the device can answer by now.
  void serve(HostTime now);
  /// When serve() may next have something to do; HostTime::max() for nothing before the host asks.
  [[nodiscard]] HostTime next_due(HostTime now);

  /// What is to be sent to the host.
  [[nodiscard]] std::span<const std::byte> output() const noexcept;
  /// The first `count` bytes of output() are sent.
  void sent(std::size_t count);

 private:
  struct Endpoint {
    InPipe pipe;
    std::deque<Submit> waiting{};
  };

  void handle(const UrbCommand& command, std::span<const std::byte> out, HostTime now);
  void submit(const Submit& request, std::span<const std::byte> out, HostTime now);
  void control(const Submit& request, std::span<const std::byte> out, HostTime now);
  void unlink(const UrbCommand& command);
  void serve(Endpoint& endpoint, HostTime now);

  UsbDevice& device_;
  std::vector<Endpoint> endpoints_;  ///< IN, by number
  Bytes input_;
  Bytes output_;
  std::size_t output_begin_ = 0;
};

}  // namespace geoflow::emulator::usbip
