#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/result.hpp"

#include "replay/decode.hpp"

namespace geoflow::drivers {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<std::uint8_t, 4> kPngHeaderChunk = {'I', 'H', 'D', 'R'};
constexpr std::array<std::uint8_t, 4> kPngEndChunk = {'I', 'E', 'N', 'D'};
constexpr std::size_t kPngLeastBytes = 8 + 25 + 12;  // signature, IHDR, IEND
constexpr std::size_t kPngWidthAt = 16;
constexpr std::size_t kPngHeightAt = 20;
constexpr std::size_t kPngBitsAt = 24;
constexpr std::size_t kPngColorTypeAt = 25;
constexpr std::uint32_t kLargestDimension = 1U << 20U;

constexpr std::uint8_t kJpegMarker = 0xff;
constexpr std::uint8_t kJpegStart = 0xd8;
constexpr std::uint8_t kJpegEnd = 0xd9;

std::uint8_t at(Bytes bytes, std::size_t index) {
  return std::to_integer<std::uint8_t>(bytes[index]);
}

std::uint32_t big_endian(Bytes bytes, std::size_t index, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    value = (value << 8U) | at(bytes, index + i);
  }
  return value;
}

template <std::size_t KSize>
bool matches(Bytes bytes, std::size_t index, const std::array<std::uint8_t, KSize>& expected) {
  return bytes.size() >= index + KSize &&
         std::ranges::equal(bytes.subspan(index, KSize), expected, {},
                            [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
}

Result<ImageHeader> read_png(Bytes bytes) {
  constexpr std::size_t kChunkNameAt = 4;
  constexpr std::size_t kChunkTail = 8;  // name and CRC of the empty last chunk
  if (bytes.size() < kPngLeastBytes ||
      !matches(bytes, kPngSignature.size() + kChunkNameAt, kPngHeaderChunk)) {
    return fail(ErrorCode::kInvalidData, "a PNG without header");
  }
  if (!matches(bytes, bytes.size() - kChunkTail, kPngEndChunk)) {
    return fail(ErrorCode::kInvalidData, "a PNG that is cut off");
  }
  const std::uint32_t width = big_endian(bytes, kPngWidthAt, 4);
  const std::uint32_t height = big_endian(bytes, kPngHeightAt, 4);
  if (width == 0 || height == 0 || width > kLargestDimension || height > kLargestDimension) {
    return fail(ErrorCode::kInvalidData, "a PNG of {} x {} pixels", width, height);
  }
  return ImageHeader{.width = static_cast<int>(width),
                     .height = static_cast<int>(height),
                     .bits = at(bytes, kPngBitsAt),
                     .is_png = true,
                     .is_gray = at(bytes, kPngColorTypeAt) == 0};
}

/// SOF0..SOF15 but DHT, JPG and DAC, which have codes among them.
bool is_frame_header(std::uint8_t marker) {
  constexpr std::uint8_t kFirst = 0xc0;
  constexpr std::uint8_t kLast = 0xcf;
  constexpr std::uint8_t kHuffmanTables = 0xc4;
  constexpr std::uint8_t kExtension = 0xc8;
  constexpr std::uint8_t kArithmeticConditioning = 0xcc;
  return marker >= kFirst && marker <= kLast && marker != kHuffmanTables && marker != kExtension &&
         marker != kArithmeticConditioning;
}

/// Whether the end marker stands last, but for zeros that some writers pad with.
bool jpeg_is_complete(Bytes bytes) {
  std::size_t end = bytes.size();
  while (end > 2 && at(bytes, end - 1) == 0) {
    --end;
  }
  return end >= 2 && at(bytes, end - 2) == kJpegMarker && at(bytes, end - 1) == kJpegEnd;
}

Result<ImageHeader> read_jpeg(Bytes bytes) {
  constexpr std::size_t kFrameHeaderBytes =
      10;  // marker, length, precision, height, width, components
  std::size_t index = 2;
  while (index + kFrameHeaderBytes <= bytes.size()) {
    if (at(bytes, index) != kJpegMarker) {
      break;
    }
    const std::uint8_t marker = at(bytes, index + 1);
    if (marker == kJpegMarker) {  // fill bytes before a marker
      ++index;
      continue;
    }
    if (is_frame_header(marker)) {
      const ImageHeader header{.width = static_cast<int>(big_endian(bytes, index + 7, 2)),
                               .height = static_cast<int>(big_endian(bytes, index + 5, 2)),
                               .bits = at(bytes, index + 4),
                               .is_gray = at(bytes, index + 9) == 1};
      if (header.width == 0 || header.height == 0) {
        break;
      }
      if (!jpeg_is_complete(bytes)) {
        return fail(ErrorCode::kInvalidData, "a JPEG that is cut off");
      }
      return header;
    }
    index += 2 + big_endian(bytes, index + 2, 2);
  }
  return fail(ErrorCode::kInvalidData, "a JPEG without header");
}

}  // namespace

Result<ImageHeader> read_header(std::span<const std::byte> bytes) {
  if (matches(bytes, 0, kPngSignature)) {
    return read_png(bytes);
  }
  if (bytes.size() > 2 && at(bytes, 0) == kJpegMarker && at(bytes, 1) == kJpegStart) {
    return read_jpeg(bytes);
  }
  return fail(ErrorCode::kInvalidData, "neither a PNG nor a JPEG image ({} bytes)", bytes.size());
}

}  // namespace geoflow::drivers
