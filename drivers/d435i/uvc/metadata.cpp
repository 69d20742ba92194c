#include "d435i/uvc/metadata.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

constexpr std::uint32_t kDepthControl = 0x80000000;
constexpr std::uint32_t kCaptureTiming = 0x80000001;
constexpr std::uint32_t kConfiguration = 0x80000002;

constexpr std::size_t kBlockHeaderBytes = 2 * sizeof(std::uint32_t);

/// The next field, if bit `flag` of `flags` says that it is valid.
template <Field T>
std::optional<T> take_if(FieldReader& fields, std::uint32_t flags, unsigned flag) {
  const T value = fields.take<T>();
  return (flags >> flag & 1U) != 0 ? std::optional{value} : std::nullopt;
}

std::uint32_t take_flags(FieldReader& fields) {
  fields.skip(sizeof(std::uint32_t));  // version
  return fields.take<std::uint32_t>();
}

CaptureTiming take_timing(FieldReader& fields) {
  const std::uint32_t flags = take_flags(fields);
  CaptureTiming timing;
  timing.frame_counter = take_if<std::uint32_t>(fields, flags, 0);
  timing.optical_time_us = take_if<std::uint32_t>(fields, flags, 1);
  fields.skip(sizeof(std::uint32_t));  // readout time
  timing.exposure_us = take_if<std::uint32_t>(fields, flags, 3);
  timing.frame_interval_us = take_if<std::uint32_t>(fields, flags, 4);
  return timing;
}

DepthControl take_depth_control(FieldReader& fields) {
  const std::uint32_t flags = take_flags(fields);
  DepthControl control;
  control.gain = take_if<std::uint32_t>(fields, flags, 0);
  control.exposure_us = take_if<std::uint32_t>(fields, flags, 1);
  control.laser_power = take_if<std::uint32_t>(fields, flags, 2);
  return control;
}

StreamConfiguration take_configuration(FieldReader& fields) {
  constexpr unsigned kWidthFlag = 4;
  constexpr unsigned kHeightFlag = 5;
  constexpr unsigned kRateFlag = 6;
  const std::uint32_t flags = take_flags(fields);
  // hardware type, unit kind, cookie, format
  fields.skip(2 * sizeof(std::uint8_t) + sizeof(std::uint32_t) + sizeof(std::uint16_t));
  StreamConfiguration configuration;
  configuration.width = take_if<std::uint16_t>(fields, flags, kWidthFlag);
  configuration.height = take_if<std::uint16_t>(fields, flags, kHeightFlag);
  configuration.rate_hz = take_if<std::uint16_t>(fields, flags, kRateFlag);
  return configuration;
}

}  // namespace

Result<FrameMetadata> parse_metadata(std::span<const std::byte> blocks) {
  FrameMetadata metadata;
  while (!blocks.empty()) {
    FieldReader start{blocks};
    const auto id = start.take<std::uint32_t>();
    const auto size = start.take<std::uint32_t>();
    if (!start.ok() || size < kBlockHeaderBytes || size > blocks.size()) {
      return fail(ErrorCode::kInvalidData, "a metadata block of {} bytes where {} are left", size,
                  blocks.size());
    }
    FieldReader fields{blocks.first(size).subspan(kBlockHeaderBytes)};
    if (id == kCaptureTiming) {
      metadata.timing = take_timing(fields);
    } else if (id == kDepthControl) {
      metadata.depth = take_depth_control(fields);
    } else if (id == kConfiguration) {
      metadata.configuration = take_configuration(fields);
    }
    if (!fields.ok()) {
      return fail(ErrorCode::kInvalidData, "metadata block {:#010x} ends after {} bytes", id, size);
    }
    blocks = blocks.subspan(size);
  }
  return metadata;
}

}  // namespace geoflow::drivers::d435i
