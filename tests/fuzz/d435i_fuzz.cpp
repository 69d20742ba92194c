#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/image.hpp"

#include "d435i/imu/reports.hpp"
#include "d435i/monitor/command.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/monitor/versions.hpp"
#include "d435i/pixels/yuyv.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "d435i/uvc/metadata.hpp"
#include "d435i/uvc/payload.hpp"
#include "fields.hpp"
#include "reasoned.hpp"

// Any bytes as everything that the camera sends: read, or refused with a reason. The first byte
// says as what, so that a corpus of one kind stays apart from the others.

namespace {

using namespace geoflow::drivers::d435i;  // NOLINT(google-build-using-namespace): its own program
using geoflow::tests::require_reason;

void read_descriptors(std::span<const std::byte> bytes) {
  const auto description = parse_configuration(bytes);
  require_reason(description);
  if (!description) {
    return;
  }
  for (const VideoMode& mode : list_modes(*description)) {
    require_reason(choose_mode(*description, mode));
  }
}

void read_payload(std::span<const std::byte> bytes) {
  const auto header = parse_payload_header(bytes);
  require_reason(header);
  if (header) {
    require_reason(parse_metadata(header->metadata));
  }
  require_reason(parse_probe(bytes));
}

void read_imu(std::span<const std::byte> bytes) {
  const auto reading = parse_input_report(bytes);
  require_reason(reading);
  if (reading && !to_si(*reading).allFinite()) {
    std::abort();
  }
  const auto feature = parse_feature_report(bytes);
  require_reason(feature);
  if (feature) {
    const auto again = parse_feature_report(encode_feature_report(*feature));
    if (!again || again->interval_ms != feature->interval_ms) {
      std::abort();
    }
  }
}

void read_monitor(std::span<const std::byte> bytes) {
  require_reason(parse_reply(bytes, Opcode::kVersions));
  require_reason(parse_versions(bytes));
  require_reason(parse_clock_us(bytes));
  require_reason(parse_depth_unit_m(bytes));
  require_reason(parse_resolution_intrinsics(bytes));
}

/// `bytes` as a table of that type whose checksum is right: a wrong one would hide everything else.
std::vector<std::byte> sealed(std::span<const std::byte> bytes, std::uint32_t type) {
  constexpr std::uint32_t kPolynomial = 0xedb88320;
  std::uint32_t crc = ~0U;
  for (const std::byte byte : bytes) {
    crc ^= std::to_integer<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? kPolynomial : 0U);
    }
  }
  geoflow::drivers::FieldWriter table;
  table.put(std::uint16_t{0}).put(static_cast<std::uint16_t>(type)).put(0U).put(0U).put(~crc);
  table.put_bytes(bytes);
  return std::move(table).take();
}

void read_tables(std::span<const std::byte> bytes) {
  require_reason(parse_depth_table(bytes));
  const auto depth = parse_depth_table(sealed(bytes, kCoefficientsTable));
  require_reason(depth);
  if (depth) {
    require_reason(depth_intrinsics(*depth, 640, 480));
    require_reason(depth_intrinsics(*depth, 256, 144));
  }
  const auto color = parse_color_table(sealed(bytes, kColorTable));
  require_reason(color);
  if (color && color_intrinsics(*color, 640, 480).width != 640) {
    std::abort();
  }
  require_reason(parse_imu_table(sealed(bytes, 0)));
}

void read_pixels(std::span<const std::byte> bytes) {
  std::vector<std::byte> target(bytes.size() * 2);
  const auto width = static_cast<int>(bytes.size() / 2);
  require_reason(convert_yuyv(bytes, {width, 1, geoflow::PixelFormat::kBgr8}, target));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const auto bytes = std::as_bytes(std::span{data, size}.subspan(1));
  constexpr std::uint8_t kKinds = 6;
  switch (data[0] % kKinds) {
    case 0:
      read_descriptors(bytes);
      break;
    case 1:
      read_payload(bytes);
      break;
    case 2:
      read_imu(bytes);
      break;
    case 3:
      read_monitor(bytes);
      break;
    case 4:
      read_tables(bytes);
      break;
    default:
      read_pixels(bytes);
      break;
  }
  return 0;
}
