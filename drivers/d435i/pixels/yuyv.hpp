#pragma once

#include <cstddef>
#include <span>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {

/// Converts YUYV (Y0 U Y1 V, BT.601) of `shape`'s size to
/// `shape.format`, kGray8 (the luma as it is), kBgr8 or kRgb8. `target` has shape.size_bytes().
/// kInvalidData where `source` is not width x height x 2 bytes; kUnsupported of any other format.
/// Pure, thread-safe.
[[nodiscard]] Result<void> convert_yuyv(std::span<const std::byte> source, const ImageShape& shape,
                                        std::span<std::byte> target);

}  // namespace geoflow::drivers::d435i
