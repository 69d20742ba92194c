#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

/// What is around the records of an MCAP chunk: Zstandard or LZ4 (frame format), and zlib's CRC-32.
namespace geoflow::drivers::bag {

/// Beyond this many bytes a chunk is refused.
inline constexpr std::uint64_t kMaxChunkBytes = std::uint64_t{256} << 20U;

/// The content of a chunk of which these bytes are stored. kUnsupported for another compression
/// than none (empty), `zstd` and `lz4`; kInvalidData where the content has not `size` bytes or
/// another checksum than `crc` (0: none is given). Pure.
[[nodiscard]] Result<std::vector<std::byte>> unpack_chunk(std::string_view compression,
                                                          std::span<const std::byte> stored,
                                                          std::uint64_t size, std::uint32_t crc);

/// zlib's CRC-32 of the bytes, going on from that of what was before them. Pure.
[[nodiscard]] std::uint32_t crc32_of(std::span<const std::byte> bytes, std::uint32_t before = 0);

}  // namespace geoflow::drivers::bag
