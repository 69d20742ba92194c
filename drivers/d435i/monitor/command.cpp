#include "d435i/monitor/command.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

constexpr std::uint16_t kMagic = 0xcdab;
constexpr std::size_t kLargestData = 1000;
// What the length field counts beside the data: the opcode and four parameters.
constexpr std::size_t kCountedHeader = 5 * sizeof(std::uint32_t);
// The length of a reply's data stands in its last bytes.
constexpr std::size_t kReplyLengthAt = kMonitorBytes - sizeof(std::uint32_t);

// Where the firmware keeps its microsecond counter (librealsense, src/ds/d400/d400-device.cpp).
constexpr std::uint32_t kClockAddress = 0x0001613c;
constexpr std::uint32_t kClockEnd = 0x00016140;

struct FirmwareError {
  std::int32_t number;
  ErrorCode code;
  std::string_view words;
};
constexpr std::array<FirmwareError, 14> kFirmwareErrors{{
    {-1, ErrorCode::kUnsupported, "unknown command"},
    {-5, ErrorCode::kInvalidData, "read only"},
    {-6, ErrorCode::kInvalidData, "wrong parameter"},
    {-7, ErrorCode::kUnavailable, "the hardware is not ready"},
    {-11, ErrorCode::kNotFound, "nothing there"},
    {-16, ErrorCode::kInvalidData, "the table is not valid"},
    {-17, ErrorCode::kNotFound, "no table of this id"},
    {-19, ErrorCode::kInvalidData, "wrong checksum"},
    {-21, ErrorCode::kNotFound, "no data to return"},
    {-25, ErrorCode::kNotFound, "the table is empty"},
    {-27, ErrorCode::kInvalidData, "locked"},
    {-41, ErrorCode::kUnavailable, "the resource is busy"},
    {-58, ErrorCode::kUnsupported, "not supported"},
    {0, ErrorCode::kInvalidData, "no answer"},
}};

tl::unexpected<Error> firmware_error(Opcode opcode, std::int32_t number) {
  const auto* const known = std::ranges::find(kFirmwareErrors, number, &FirmwareError::number);
  const bool found = known != kFirmwareErrors.end();
  return fail(found ? known->code : ErrorCode::kInvalidData,
              "hardware monitor, command {:#04x}: {} ({})", static_cast<std::uint32_t>(opcode),
              found ? known->words : "unknown answer", number);
}

}  // namespace

std::vector<std::byte> encode_command(const MonitorCommand& command) {
  const auto data = command.data.first(std::min(command.data.size(), kLargestData));
  FieldWriter request;
  request.put(static_cast<std::uint16_t>(kCountedHeader + data.size()))
      .put(kMagic)
      .put(static_cast<std::uint32_t>(command.opcode));
  for (const std::uint32_t parameter : command.parameters) {
    request.put(parameter);
  }
  request.put_bytes(data).pad_to(kMonitorBytes);
  return std::move(request).take();
}

Result<std::span<const std::byte>> parse_reply(std::span<const std::byte> reply, Opcode opcode) {
  if (reply.size() != kMonitorBytes) {
    return fail(ErrorCode::kInvalidData, "a hardware monitor reply of {} bytes instead of {}",
                reply.size(), kMonitorBytes);
  }
  FieldReader fields{reply};
  const auto echo = fields.take<std::uint32_t>();
  if (echo != static_cast<std::uint32_t>(opcode)) {
    return firmware_error(opcode, static_cast<std::int32_t>(echo));
  }
  const auto length = FieldReader{reply.subspan(kReplyLengthAt)}.take<std::uint32_t>();
  const auto room = reply.first(kReplyLengthAt).subspan(sizeof(echo));
  if (length > room.size()) {
    return fail(ErrorCode::kInvalidData, "a hardware monitor reply that says it has {} bytes",
                length);
  }
  return room.first(length);
}

std::vector<std::byte> encode_clock_command() {
  return encode_command(
      {.opcode = Opcode::kReadMemory, .parameters = {kClockAddress, kClockEnd, 0, 0}});
}

Result<std::uint32_t> parse_clock_us(std::span<const std::byte> data) {
  FieldReader fields{data};
  const auto clock_us = fields.take<std::uint32_t>();
  if (!fields.ok()) {
    return fail(ErrorCode::kInvalidData, "{} bytes where the camera's clock has 4", data.size());
  }
  return clock_us;
}

}  // namespace geoflow::drivers::d435i
