#pragma once

#include <cstddef>
#include <span>

#include "geoflow/hal/image.hpp"

namespace geoflow::drivers {

/// One row of kGray8, kBgr8 or kRgb8 in the target's format, which is one of them too and has as
/// many pixels. Gray is the luma of ITU-R BT.601 (2.5.1), rounded. Pure.
void convert_color_row(PixelFormat source_format, std::span<const std::byte> source,
                       PixelFormat target_format, std::span<std::byte> target);

}  // namespace geoflow::drivers
