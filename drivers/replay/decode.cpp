#include "replay/decode.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include <fmt/core.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "color_row.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

constexpr int kDepthBits = 16;

const char* stream_name(ImageStream stream) {
  return stream == ImageStream::kDepth ? "depth" : "colour";
}

Result<void> check_size(int width, int height, const DecodeOptions& options) {
  const bool any = options.width == 0;
  const bool fits = any ? width > 0 && height > 0 && width <= kLargestSide && height <= kLargestSide
                        : width == options.width && height == options.height;
  if (fits) {
    return {};
  }
  if (any) {
    return fail(ErrorCode::kInvalidData, "{} x {} pixels, at most {} are read", width, height,
                kLargestSide);
  }
  return fail(ErrorCode::kInvalidData, "{} x {} pixels, but the calibration is for {} x {}", width,
              height, options.width, options.height);
}

Result<FrameRef> acquire_frame(const ImageShape& shape, const AcquireFrame& acquire) {
  FrameRef frame = acquire(shape);
  if (!frame) {
    return fail(ErrorCode::kUnavailable, "no buffer is free");
  }
  return frame;
}

ImageShape target_shape(int width, int height, ImageStream stream, const DecodeOptions& options) {
  const PixelFormat color = options.color_as_gray ? PixelFormat::kGray8 : PixelFormat::kBgr8;
  return {.width = width,
          .height = height,
          .format = stream == ImageStream::kDepth ? PixelFormat::kDepth16 : color};
}

int mat_type(PixelFormat format) {
  if (format == PixelFormat::kDepth16) {
    return CV_16UC1;
  }
  return format == PixelFormat::kGray8 ? CV_8UC1 : CV_8UC3;
}

int read_flags(PixelFormat format) {
  if (format == PixelFormat::kDepth16) {
    return cv::IMREAD_UNCHANGED;
  }
  const int color = format == PixelFormat::kGray8 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR;
  return color | cv::IMREAD_IGNORE_ORIENTATION;
}

/// Lets OpenCV write into the frame's own memory.
bool decode_into(std::span<const std::byte> bytes, FrameRef& frame) {
  const ImageShape& shape = frame.shape();
  cv::Mat target{shape.height, shape.width, mat_type(shape.format), frame.writable_bytes().data()};
  const uchar* const memory = target.data;
  // OpenCV takes its input as a non-const Mat, but does not write to it.
  const cv::Mat input{
      1, static_cast<int>(bytes.size()), CV_8UC1,
      const_cast<std::byte*>(bytes.data())};  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  try {
    cv::imdecode(input, read_flags(shape.format), &target);
  } catch (const cv::Exception&) {
    return false;
  }
  return !target.empty() && target.data == memory;
}

Result<FrameRef> decode_compressed(const EncodedImage& image, const DecodeOptions& options,
                                   const AcquireFrame& acquire) {
  const auto header = read_header(image.bytes);
  if (!header) {
    return tl::unexpected{header.error()};
  }
  if (auto checked = check_size(header->width, header->height, options); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  if (image.stream == ImageStream::kDepth && (header->bits != kDepthBits || !header->is_gray)) {
    return fail(ErrorCode::kInvalidData, "a {} of {} bits{}, but depth is a 16-bit gray PNG",
                header->is_png ? "PNG" : "JPEG", header->bits, header->is_gray ? "" : " in colour");
  }
  auto frame =
      acquire_frame(target_shape(header->width, header->height, image.stream, options), acquire);
  if (frame && !decode_into(image.bytes, *frame)) {
    return fail(ErrorCode::kInvalidData, "a damaged {}", header->is_png ? "PNG" : "JPEG");
  }
  return frame;
}

std::uint16_t depth_of_metres(const std::byte* source, bool big_endian, double unit_m) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, source, sizeof bits);
  const double counts =
      static_cast<double>(std::bit_cast<float>(big_endian ? __builtin_bswap32(bits) : bits)) /
      unit_m;
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  return counts > 0 && counts <= kMost ? static_cast<std::uint16_t>(std::lround(counts))
                                       : std::uint16_t{0};
}

void copy_depth_row(const EncodedImage& image, const std::byte* source, std::span<std::byte> target,
                    double unit_m) {
  const std::size_t pixels = target.size() / sizeof(std::uint16_t);
  for (std::size_t x = 0; x < pixels; ++x) {
    std::uint16_t value = 0;
    if (image.raw.metres_f32) {
      value = depth_of_metres(source + x * sizeof(float), image.raw.big_endian, unit_m);
    } else {
      std::memcpy(&value, source + x * sizeof value, sizeof value);
      value = image.raw.big_endian ? __builtin_bswap16(value) : value;
    }
    std::memcpy(target.data() + x * sizeof value, &value, sizeof value);
  }
}

Result<FrameRef> decode_raw(const EncodedImage& image, const DecodeOptions& options,
                            const AcquireFrame& acquire) {
  const RawLayout& raw = image.raw;
  if (auto checked = check_size(raw.shape.width, raw.shape.height, options); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  if ((raw.shape.format == PixelFormat::kDepth16) != (image.stream == ImageStream::kDepth) ||
      raw.shape.format == PixelFormat::kYuyv) {
    return fail(ErrorCode::kInvalidData, "its pixel format does not fit its stream");
  }
  const std::size_t row_bytes = raw.metres_f32
                                    ? static_cast<std::size_t>(raw.shape.width) * sizeof(float)
                                    : raw.shape.row_bytes();
  const auto rows = static_cast<std::size_t>(raw.shape.height);
  const std::size_t step = std::min(raw.step_bytes, image.bytes.size());
  if (raw.step_bytes < row_bytes || image.bytes.size() < row_bytes ||
      (image.bytes.size() - row_bytes) / std::max<std::size_t>(step, 1) < rows - 1) {
    return fail(ErrorCode::kInvalidData, "{} bytes in steps of {} are too few for {} x {} pixels",
                image.bytes.size(), raw.step_bytes, raw.shape.width, raw.shape.height);
  }
  auto frame = acquire_frame(target_shape(raw.shape.width, raw.shape.height, image.stream, options),
                             acquire);
  if (!frame) {
    return frame;
  }
  const ImageShape shape = frame->shape();
  for (std::size_t y = 0; y < rows; ++y) {
    const std::byte* source = image.bytes.data() + y * step;
    const auto target = frame->writable_bytes().subspan(y * shape.row_bytes(), shape.row_bytes());
    if (shape.format == PixelFormat::kDepth16) {
      copy_depth_row(image, source, target, options.depth_unit_m);
    } else {
      convert_color_row(raw.shape.format, {source, row_bytes}, shape.format, target);
    }
  }
  return frame;
}

}  // namespace

Result<FrameRef> decode(const EncodedImage& image, const DecodeOptions& options,
                        const AcquireFrame& acquire) {
  auto frame = image.encoding == ImageEncoding::kRaw ? decode_raw(image, options, acquire)
                                                     : decode_compressed(image, options, acquire);
  return std::move(frame).map_error([&](Error error) {
    return std::move(error).in(
        fmt::format("{}: {} image", image.origin, stream_name(image.stream)));
  });
}

}  // namespace geoflow::drivers
