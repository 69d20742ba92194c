#include "src/messages.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator::usbip {
namespace {

constexpr unsigned kByteBits = 8;
constexpr std::uint16_t kVersion = 0x0111;
constexpr std::uint16_t kListReply = 0x0005;
constexpr std::uint16_t kImportReply = 0x0003;
constexpr std::uint32_t kLastEndpoint = 15;
constexpr std::int32_t kNotIsochronous = -1;  // packets of a transfer, as newer kernels say

std::uint32_t big_endian(std::span<const std::byte> bytes, std::size_t offset, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    value = (value << kByteBits) | std::to_integer<std::uint32_t>(bytes[offset + i]);
  }
  return value;
}

template <typename Integer>
void put(Integer value, Bytes& to) {
  for (std::size_t i = sizeof(Integer); i-- > 0;) {
    to.push_back(static_cast<std::byte>(static_cast<std::uint32_t>(value) >> (kByteBits * i)));
  }
}

void put_text(std::string_view text, std::size_t size, Bytes& to) {
  for (std::size_t i = 0; i < size; ++i) {
    to.push_back(i < text.size() ? static_cast<std::byte>(text[i]) : std::byte{0});
  }
}

/// Header of a reply to one request: command, sequence number; device, direction and endpoint are
/// 0.
void put_reply_header(Command command, std::uint32_t sequence, Bytes& to) {
  constexpr std::size_t kUnused = 12;
  put(static_cast<std::uint32_t>(command), to);
  put(sequence, to);
  to.resize(to.size() + kUnused);
}

SetupPacket decode_setup(std::span<const std::byte> bytes) {
  const auto u8 = [&](std::size_t i) { return std::to_integer<std::uint8_t>(bytes[i]); };
  const auto u16 = [&](std::size_t i) {
    return static_cast<std::uint16_t>(u8(i) | (unsigned{u8(i + 1)} << kByteBits));
  };
  return {
      .request_type = u8(0), .request = u8(1), .value = u16(2), .index = u16(4), .length = u16(6)};
}

Result<UrbCommand> decode_submit(std::span<const std::byte> header) {
  constexpr std::size_t kDirectionAt = 12;
  constexpr std::size_t kEndpointAt = 16;
  constexpr std::size_t kLengthAt = 24;
  constexpr std::size_t kPacketsAt = 32;
  constexpr std::size_t kSetupAt = 40;
  Submit submit{.sequence = big_endian(header, 4, 4)};
  const std::uint32_t direction = big_endian(header, kDirectionAt, 4);
  const std::uint32_t endpoint = big_endian(header, kEndpointAt, 4);
  const auto packets = static_cast<std::int32_t>(big_endian(header, kPacketsAt, 4));
  submit.length = big_endian(header, kLengthAt, 4);
  if (direction > 1 || endpoint > kLastEndpoint) {
    return fail(ErrorCode::kInvalidData, "request {}: direction {}, endpoint {}: there is none",
                submit.sequence, direction, endpoint);
  }
  if (submit.length > kMostTransfer) {
    return fail(ErrorCode::kInvalidData, "request {}: a transfer of {} bytes; at most {}",
                submit.sequence, submit.length, kMostTransfer);
  }
  if (packets != 0 && packets != kNotIsochronous) {
    return fail(ErrorCode::kUnsupported,
                "request {}: isochronous, on a device that has no such endpoint", submit.sequence);
  }
  submit.in = direction == 1;
  submit.endpoint = static_cast<std::uint8_t>(endpoint);
  submit.setup = decode_setup(header.subspan(kSetupAt));
  return UrbCommand{.submit = submit, .sequence = submit.sequence};
}

/// The part that both replies have: paths, numbers and the device descriptor's fields.
void put_device(const Announcement& device, Bytes& to) {
  constexpr std::size_t kPathSize = 256;
  constexpr std::size_t kVendorAt = 8;
  constexpr std::size_t kProductAt = 10;
  constexpr std::size_t kReleaseAt = 12;
  constexpr std::size_t kClassAt = 4;
  constexpr std::size_t kClassFields = 3;
  constexpr std::size_t kConfigurationsAt = 17;
  constexpr std::size_t kInterfacesAt = 4;
  constexpr std::size_t kValueAt = 5;
  put_text("/sys/devices/geoflow/" + device.bus_id, kPathSize, to);
  put_text(device.bus_id, kBusIdSize, to);
  put(device.bus, to);
  put(device.number, to);
  put(static_cast<std::uint32_t>(device.speed), to);
  for (const std::size_t at : {kVendorAt, kProductAt, kReleaseAt}) {
    to.push_back(device.device[at + 1]);
    to.push_back(device.device[at]);
  }
  to.insert(to.end(), device.device.begin() + kClassAt,
            device.device.begin() + kClassAt + kClassFields);
  to.push_back(device.configuration[kValueAt]);
  to.push_back(device.device[kConfigurationsAt]);
  to.push_back(device.configuration[kInterfacesAt]);
}

/// Class, subclass and protocol of each interface, and a byte of padding.
void put_interfaces(const Announcement& device, Bytes& to) {
  constexpr std::byte kInterface{4};
  constexpr std::size_t kAlternateAt = 3;
  constexpr std::size_t kClassAt = 5;
  const Bytes& all = device.configuration;
  for (std::size_t at = 0; at + 1 < all.size();) {
    if (all[at + 1] == kInterface && all[at + kAlternateAt] == std::byte{0}) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(at + kClassAt);
      to.insert(to.end(), begin, begin + 3);
      to.push_back(std::byte{0});
    }
    at += std::max<std::size_t>(std::to_integer<std::size_t>(all[at]), 2);
  }
}

void put_operation(std::uint16_t code, bool failed, Bytes& to) {
  put(kVersion, to);
  put(code, to);
  put(std::uint32_t{failed ? 1U : 0U}, to);
}

}  // namespace

Result<UrbCommand> decode_urb(std::span<const std::byte> header) {
  constexpr std::size_t kUnlinkedAt = 20;
  const std::uint32_t command = big_endian(header, 0, 4);
  switch (static_cast<Command>(command)) {
    case Command::kSubmit:
      return decode_submit(header);
    case Command::kUnlink:
      return UrbCommand{.sequence = big_endian(header, 4, 4),
                        .unlinked = big_endian(header, kUnlinkedAt, 4)};
    default:
      return fail(ErrorCode::kInvalidData, "message {} is no request of USB/IP", command);
  }
}

void put_return_submit(std::uint32_t sequence, std::int32_t status, std::uint32_t actual,
                       std::span<const std::byte> data, Bytes& to) {
  const std::size_t end = to.size() + kUrbHeaderSize;
  put_reply_header(Command::kReturnSubmit, sequence, to);
  put(status, to);
  put(actual, to);
  put(std::uint32_t{0}, to);  // start frame
  put(std::uint32_t{0}, to);  // isochronous packets, and errors among them
  to.resize(end);
  to.insert(to.end(), data.begin(), data.end());
}

void put_return_unlink(std::uint32_t sequence, std::int32_t status, Bytes& to) {
  const std::size_t end = to.size() + kUrbHeaderSize;
  put_reply_header(Command::kReturnUnlink, sequence, to);
  put(status, to);
  to.resize(end);
}

Result<Operation> decode_operation(std::span<const std::byte> header) {
  const std::uint32_t version = big_endian(header, 0, 2);
  const std::uint32_t code = big_endian(header, 2, 2);
  if (version != kVersion) {
    return fail(ErrorCode::kUnsupported, "USB/IP of version {:#06x}; this is {:#06x}", version,
                kVersion);
  }
  const auto operation = static_cast<Operation>(code);
  if (operation != Operation::kListDevices && operation != Operation::kImport) {
    return fail(ErrorCode::kUnsupported, "USB/IP operation {:#06x}", code);
  }
  return operation;
}

Bytes list_reply(const Announcement& device) {
  Bytes reply;
  put_operation(kListReply, false, reply);
  put(std::uint32_t{1}, reply);  // devices
  put_device(device, reply);
  put_interfaces(device, reply);
  return reply;
}

Bytes import_reply(const Announcement& device, bool found) {
  Bytes reply;
  put_operation(kImportReply, !found, reply);
  if (found) {
    put_device(device, reply);
  }
  return reply;
}

}  // namespace geoflow::emulator::usbip
