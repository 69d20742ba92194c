#include "d435i/monitor/versions.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>

#include <fmt/format.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {
namespace {

// Offsets in the answer [bytes].
constexpr std::size_t kFirmwareAt = 12;
constexpr std::size_t kModuleSerialAt = 48;
constexpr std::size_t kAsicSerialAt = 64;
constexpr std::size_t kColorAt = 174;
constexpr std::size_t kImuAt = 178;
constexpr std::size_t kSerialBytes = 6;

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    fmt::format_to(std::back_inserter(text), "{:02x}", std::to_integer<unsigned>(byte));
  }
  return text;
}

}  // namespace

std::string FirmwareVersion::text() const {
  return fmt::format("{}.{}.{}.{}", parts[0], parts[1], parts[2], parts[3]);
}

Result<Versions> parse_versions(std::span<const std::byte> data) {
  if (data.size() <= kImuAt) {
    return fail(ErrorCode::kInvalidData, "version data of {} bytes where more than {} are expected",
                data.size(), kImuAt);
  }
  Versions versions;
  std::ranges::transform(data.subspan(kFirmwareAt, versions.firmware.parts.size()),
                         versions.firmware.parts.rbegin(),
                         [](std::byte part) { return std::to_integer<std::uint8_t>(part); });
  versions.serial = hex(data.subspan(kModuleSerialAt, kSerialBytes));
  versions.asic_serial = hex(data.subspan(kAsicSerialAt, kSerialBytes));
  versions.has_color = data[kColorAt] != std::byte{0};
  versions.has_imu = data[kImuAt] != std::byte{0};
  return versions;
}

}  // namespace geoflow::drivers::d435i
