#include "openni2/pixels.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "color_row.hpp"
#include "d435i/pixels/yuyv.hpp"

namespace geoflow::drivers::openni2 {
namespace {

std::size_t bytes_of(SourcePixel pixel) {
  switch (pixel) {
    case SourcePixel::kGray8:
      return bytes_per_pixel(PixelFormat::kGray8);
    case SourcePixel::kRgb888:
      return bytes_per_pixel(PixelFormat::kRgb8);
    case SourcePixel::kDepth:
    case SourcePixel::kYuyv:
    case SourcePixel::kUyvy:
      return 2;
  }
  return 0;
}

/// U Y0 V Y1 in the order Y0 U Y1 V.
std::vector<std::byte> swapped(std::span<const std::byte> row) {
  std::vector<std::byte> yuyv(row.size());
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    yuyv[i] = row[i + 1];
    yuyv[i + 1] = row[i];
  }
  return yuyv;
}

Result<void> convert_row(SourcePixel pixel, std::span<const std::byte> row, const ImageShape& line,
                         std::span<std::byte> target) {
  switch (pixel) {
    case SourcePixel::kDepth:
      std::ranges::copy(row, target.begin());
      return {};
    case SourcePixel::kRgb888:
      convert_color_row(PixelFormat::kRgb8, row, line.format, target);
      return {};
    case SourcePixel::kGray8:
      convert_color_row(PixelFormat::kGray8, row, line.format, target);
      return {};
    case SourcePixel::kYuyv:
      return d435i::convert_yuyv(row, line, target);
    case SourcePixel::kUyvy:
      return d435i::convert_yuyv(swapped(row), line, target);
  }
  return {};
}

}  // namespace

Result<void> convert(const SourceImage& source, const ImageShape& shape,
                     std::span<std::byte> target) {
  const bool depth = source.pixel == SourcePixel::kDepth;
  const bool known =
      depth ? shape.format == PixelFormat::kDepth16
            : shape.format == PixelFormat::kGray8 || shape.format == PixelFormat::kBgr8;
  if (!known) {
    return fail(ErrorCode::kUnsupported, "colour becomes gray or BGR, depth becomes depth only");
  }
  const std::size_t row_bytes = static_cast<std::size_t>(shape.width) * bytes_of(source.pixel);
  const std::size_t needed =
      shape.height > 0 ? static_cast<std::size_t>(shape.height - 1) * source.step_bytes + row_bytes
                       : 0;
  if (source.width != shape.width || source.height != shape.height ||
      source.step_bytes < row_bytes || source.bytes.size() < needed) {
    return fail(ErrorCode::kInvalidData, "{} bytes, {}x{}, where {}x{} is expected",
                source.bytes.size(), source.width, source.height, shape.width, shape.height);
  }
  const ImageShape line{.width = shape.width, .height = 1, .format = shape.format};
  for (int y = 0; y < shape.height; ++y) {
    const auto at = static_cast<std::size_t>(y);
    auto done = convert_row(source.pixel, source.bytes.subspan(at * source.step_bytes, row_bytes),
                            line, target.subspan(at * line.row_bytes(), line.row_bytes()));
    if (!done) {
      return done;
    }
  }
  return {};
}

}  // namespace geoflow::drivers::openni2
