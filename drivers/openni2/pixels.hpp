#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::openni2 {

/// What a pixel of a camera is.
enum class SourcePixel : std::uint8_t {
  kDepth,  ///< 16 bits, in the device's unit
  kRgb888,
  kGray8,
  kYuyv,  ///< Y0 U Y1 V
  kUyvy,  ///< U Y0 V Y1: what OpenNI calls YUV422
};

/// Rows as a camera gives them.
struct SourceImage {
  SourcePixel pixel = SourcePixel::kGray8;
  int width = 0;               ///< [px]
  int height = 0;              ///< [px]
  std::size_t step_bytes = 0;  ///< from row to row
  std::span<const std::byte> bytes{};
};

/// Converts to `shape`, of the same size: depth to kDepth16, the others to kGray8 or kBgr8.
/// `target` has shape.size_bytes(). kInvalidData where bytes are missing or the size is another;
/// kUnsupported for other formats. Pure.
[[nodiscard]] Result<void> convert(const SourceImage& source, const ImageShape& shape,
                                   std::span<std::byte> target);

}  // namespace geoflow::drivers::openni2
