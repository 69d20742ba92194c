#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

/// Messages of USB/IP, version 1.1.1 (kernel documentation, usb/usbip_protocol). All numbers are
/// big endian.
namespace geoflow::emulator::usbip {

inline constexpr std::size_t kUrbHeaderSize = 48;
/// No host asks for more at once: uvcvideo for 32 KiB, libusb for a whole frame.
inline constexpr std::uint32_t kMostTransfer = 16U << 20U;

enum class Command : std::uint32_t {
  kSubmit = 1,
  kUnlink = 2,
  kReturnSubmit = 3,
  kReturnUnlink = 4
};

/// A USB request of the host.
struct Submit {
  std::uint32_t sequence = 0;
  std::uint8_t endpoint = 0;  ///< without its direction
  bool in = false;
  std::uint32_t length = 0;  ///< of the transfer [bytes], at most kMostTransfer
  SetupPacket setup{};       ///< of endpoint 0

  /// Bytes that follow its header.
  [[nodiscard]] std::size_t out_size() const noexcept { return in ? 0 : length; }
};

/// One message from the host, without the data that follows it.
struct UrbCommand {
  std::optional<Submit> submit{};  ///< else an unlink
  std::uint32_t sequence = 0;
  std::uint32_t unlinked = 0;  ///< the sequence number of the request to forget
};

/// Decodes a header of kUrbHeaderSize bytes. Errors: unknown commands, isochronous transfers,
/// transfers that are too long, endpoints that USB has not.
[[nodiscard]] Result<UrbCommand> decode_urb(std::span<const std::byte> header);

/// Appends the end of a request: `status` 0 or a negative errno of Linux, its `actual` length, and
/// the data of one to the host.
void put_return_submit(std::uint32_t sequence, std::int32_t status, std::uint32_t actual,
                       std::span<const std::byte> data, Bytes& to);
void put_return_unlink(std::uint32_t sequence, std::int32_t status, Bytes& to);

/// How a device is announced before it is attached.
struct Announcement {
  std::string bus_id;  ///< shorter than 32 characters
  std::uint32_t bus = 1;
  std::uint32_t number = 2;
  UsbSpeed speed = UsbSpeed::kSuper;
  Bytes device{};         ///< its device descriptor
  Bytes configuration{};  ///< and that of its configuration
};

/// Requests before the attachment.
enum class Operation : std::uint16_t { kListDevices = 0x8005, kImport = 0x8003 };
inline constexpr std::size_t kOperationHeaderSize = 8;
inline constexpr std::size_t kBusIdSize = 32;

/// Decodes their header. Errors: another version, another operation.
[[nodiscard]] Result<Operation> decode_operation(std::span<const std::byte> header);
[[nodiscard]] Bytes list_reply(const Announcement& device);
/// `found`: it is the device that was asked for, and nobody else has it.
[[nodiscard]] Bytes import_reply(const Announcement& device, bool found);

}  // namespace geoflow::emulator::usbip
