#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::oni {

/// Undoes OpenNI's compression of depth to exactly `pixels` values. Values follow each other as
/// differences in half bytes, in bytes, as values of 15 bits, or as repetitions; `with_table`: they
/// are indices into a table of depths at the beginning. kInvalidData where bytes or pixels are
/// missing, there are too many, or an index is outside the table. Pure.
/// Source: OpenNI2, Source/Drivers/OniFile/Formats/XnStreamCompression.cpp.
[[nodiscard]] Result<std::vector<std::uint16_t>> decode_depth(std::span<const std::byte> bytes,
                                                              bool with_table, std::size_t pixels);

}  // namespace geoflow::drivers::oni
