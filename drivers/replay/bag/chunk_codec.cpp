#include "replay/bag/chunk_codec.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <lz4frame.h>
#include <tl/expected.hpp>
#include <zlib.h>
#include <zstd.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::bag {
namespace {

using Bytes = std::vector<std::byte>;

Result<Bytes> from_zstd(std::span<const std::byte> stored, std::uint64_t size) {
  const unsigned long long stated = ZSTD_getFrameContentSize(stored.data(), stored.size());
  if (stated == ZSTD_CONTENTSIZE_ERROR || (stated != ZSTD_CONTENTSIZE_UNKNOWN && stated > size)) {
    return fail(ErrorCode::kInvalidData, "is no Zstandard frame of {} bytes", size);
  }
  Bytes content(size);
  const std::size_t code =
      ZSTD_decompress(content.data(), content.size(), stored.data(), stored.size());
  if (ZSTD_isError(code) != 0U) {
    return fail(ErrorCode::kInvalidData, "is a damaged Zstandard frame: {}",
                ZSTD_getErrorName(code));
  }
  content.resize(code);
  return content;
}

Result<Bytes> from_lz4(std::span<const std::byte> stored, std::uint64_t size) {
  constexpr std::uint64_t kHighestRatio = 255;  // LZ4 block format: a length takes a byte for 255
  if (size / kHighestRatio > stored.size()) {
    return fail(ErrorCode::kInvalidData, "has {} bytes, which cannot be LZ4 of {}", stored.size(),
                size);
  }
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0U) {
    return fail(ErrorCode::kSystem, "LZ4: no memory");
  }
  const auto free = [](LZ4F_dctx* owned) { LZ4F_freeDecompressionContext(owned); };
  const std::unique_ptr<LZ4F_dctx, decltype(free)> context{made, free};
  Bytes content(size);
  std::span<std::byte> room{content};
  std::size_t wanted = 1;
  while (wanted != 0 && !stored.empty()) {
    std::size_t written = room.size();
    std::size_t read = stored.size();
    wanted = LZ4F_decompress(context.get(), room.data(), &written, stored.data(), &read, nullptr);
    if (LZ4F_isError(wanted) != 0U) {
      return fail(ErrorCode::kInvalidData, "is a damaged LZ4 frame: {}", LZ4F_getErrorName(wanted));
    }
    if (written == 0 && read == 0) {
      break;  // more content than there is room for
    }
    room = room.subspan(written);
    stored = stored.subspan(read);
  }
  if (wanted != 0) {
    return fail(ErrorCode::kInvalidData, "is an LZ4 frame that does not end after {} bytes", size);
  }
  content.resize(content.size() - room.size());
  return content;
}

Result<Bytes> decompressed(std::string_view compression, std::span<const std::byte> stored,
                           std::uint64_t size) {
  if (size > kMaxChunkBytes) {
    return fail(ErrorCode::kUnsupported, "has {} bytes of content, more than the limit of {}", size,
                kMaxChunkBytes);
  }
  if (compression.empty()) {
    return Bytes{stored.begin(), stored.end()};
  }
  if (compression == "zstd") {
    return from_zstd(stored, size);
  }
  if (compression == "lz4") {
    return from_lz4(stored, size);
  }
  return fail(ErrorCode::kUnsupported, "compression '{}' is not supported, only zstd and lz4",
              compression);
}

}  // namespace

std::uint32_t crc32_of(std::span<const std::byte> bytes, std::uint32_t before) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): zlib's bytes are unsigned char
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());
  return static_cast<std::uint32_t>(::crc32_z(before, data, bytes.size()));
}

Result<Bytes> unpack_chunk(std::string_view compression, std::span<const std::byte> stored,
                           std::uint64_t size, std::uint32_t crc) {
  auto content = decompressed(compression, stored, size);
  if (!content) {
    return content;
  }
  if (content->size() != size) {
    return fail(ErrorCode::kInvalidData, "has {} bytes of content, {} are stated", content->size(),
                size);
  }
  if (crc != 0 && crc32_of(*content) != crc) {
    return fail(ErrorCode::kInvalidData, "has another checksum than is stated: it is damaged");
  }
  return content;
}

}  // namespace geoflow::drivers::bag
