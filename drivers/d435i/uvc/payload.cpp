#include "d435i/uvc/payload.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "d435i/uvc/descriptors.hpp"
#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

// bmHeaderInfo
constexpr unsigned kFrameId = 1U << 0U;
constexpr unsigned kEndOfFrame = 1U << 1U;
constexpr unsigned kHasPts = 1U << 2U;
constexpr unsigned kHasScr = 1U << 3U;
constexpr unsigned kError = 1U << 6U;

constexpr std::size_t kScrBytes = sizeof(std::uint32_t) + sizeof(std::uint16_t);

// bmHint: the frame interval is the one field that the camera is to keep.
constexpr std::uint16_t kKeepInterval = 1;

constexpr std::uint16_t kUvc11 = 0x0110;
constexpr std::uint16_t kUvc15 = 0x0150;
constexpr std::size_t kProbeBytes10 = 26;
constexpr std::size_t kProbeBytes11 = 34;
constexpr std::size_t kProbeBytes15 = 48;

// wKeyFrameRate, wPFrameRate, wCompQuality, wCompWindowSize, wDelay
constexpr std::size_t kCompressionBytes = 5 * sizeof(std::uint16_t);

}  // namespace

Result<PayloadHeader> parse_payload_header(std::span<const std::byte> payload) {
  FieldReader start{payload};
  const auto length = start.take<std::uint8_t>();
  const unsigned info = start.take<std::uint8_t>();
  if (!start.ok() || length > payload.size()) {
    return fail(ErrorCode::kInvalidData, "a payload header of {} bytes in a payload of {}", length,
                payload.size());
  }
  FieldReader fields{payload.first(length)};
  fields.skip(2);
  PayloadHeader header{.length = length,
                       .frame_id = (info & kFrameId) != 0,
                       .end_of_frame = (info & kEndOfFrame) != 0,
                       .error = (info & kError) != 0};
  if ((info & kHasPts) != 0) {
    header.pts_us = fields.take<std::uint32_t>();
  }
  if ((info & kHasScr) != 0) {
    fields.skip(kScrBytes);
  }
  if (!fields.ok()) {
    return fail(ErrorCode::kInvalidData, "a payload header of {} bytes that says {:#04x} holds",
                length, info);
  }
  header.metadata = fields.left();
  return header;
}

std::size_t probe_bytes(std::uint16_t uvc_version) noexcept {
  if (uvc_version >= kUvc15) {
    return kProbeBytes15;
  }
  return uvc_version >= kUvc11 ? kProbeBytes11 : kProbeBytes10;
}

std::vector<std::byte> encode_probe(const ModeChoice& choice, std::uint16_t uvc_version) {
  FieldWriter block;
  block.put(kKeepInterval)
      .put(choice.format_index)
      .put(choice.frame_index)
      .put(choice.interval_100ns)
      .pad_to(probe_bytes(uvc_version));
  return std::move(block).take();
}

Result<ProbeCommit> parse_probe(std::span<const std::byte> block) {
  FieldReader fields{block};
  ProbeCommit probe;
  probe.hint = fields.take<std::uint16_t>();
  probe.format_index = fields.take<std::uint8_t>();
  probe.frame_index = fields.take<std::uint8_t>();
  probe.interval_100ns = fields.take<std::uint32_t>();
  fields.skip(kCompressionBytes);
  probe.max_frame_bytes = fields.take<std::uint32_t>();
  probe.max_payload_bytes = fields.take<std::uint32_t>();
  if (!fields.ok()) {
    return fail(ErrorCode::kInvalidData, "{} bytes of stream parameters where {} are the least",
                block.size(), kProbeBytes10);
  }
  return probe;
}

}  // namespace geoflow::drivers::d435i
