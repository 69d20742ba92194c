#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers {

/// No image is wider or higher [px].
inline constexpr int kLargestSide = 8192;

/// What an image must be and become.
struct DecodeOptions {
  int width = 0;               ///< [px]; 0: whatever the image says, up to kLargestSide
  int height = 0;              ///< [px]
  bool color_as_gray = false;  ///< colour becomes kGray8 instead of kBgr8
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double depth_unit_m = 1e-3;  ///< of the kDepth16 that depth in floating metres becomes
};

/// The size and kind of a compressed image by its first bytes.
struct ImageHeader {
  int width = 0;
  int height = 0;
  int bits = 0;          ///< of one sample
  bool is_png = false;   ///< else JPEG
  bool is_gray = false;  ///< one sample a pixel
};

/// Reads a PNG's or JPEG's header (ISO 15948 5.6 and 11.2.2; ITU T.81 B.2). Pure; bounded by the
/// input.
[[nodiscard]] Result<ImageHeader> read_header(std::span<const std::byte> bytes);

/// A source of frames of unspecified content for decode(); may return an empty one.
using AcquireFrame = std::function<FrameRef(const ImageShape&)>;

/// The pixels of `image`: PNG and JPEG by OpenCV, raw ones by copy (and conversion of byte order or
/// float metres). Colour becomes kBgr8 (or kGray8), depth kDepth16. Nothing is decoded before size,
/// kind and completeness are checked. Errors name the image's origin; kUnavailable where `acquire`
/// gave none. Thread-safe.
[[nodiscard]] Result<FrameRef> decode(const EncodedImage& image, const DecodeOptions& options,
                                      const AcquireFrame& acquire);

}  // namespace geoflow::drivers
