#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/bag/samples.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::bag {
namespace {

/// A name of sensor_msgs/image_encodings.hpp and what it means here.
struct EncodingName {
  std::string_view name;
  PixelFormat format;
  bool metres_f32 = false;
};

constexpr std::size_t kFloatBytes = 4;

// The first name of a format is the one that is written.
constexpr std::array kColorEncodings{
    EncodingName{.name = "rgb8", .format = PixelFormat::kRgb8},
    EncodingName{.name = "bgr8", .format = PixelFormat::kBgr8},
    EncodingName{.name = "8UC3", .format = PixelFormat::kBgr8},
    EncodingName{.name = "mono8", .format = PixelFormat::kGray8},
    EncodingName{.name = "8UC1", .format = PixelFormat::kGray8},
    EncodingName{.name = "yuv422_yuy2", .format = PixelFormat::kYuyv},
};
constexpr std::array kDepthEncodings{
    EncodingName{.name = "16UC1", .format = PixelFormat::kDepth16},
    EncodingName{.name = "mono16", .format = PixelFormat::kDepth16},
    EncodingName{.name = "32FC1", .format = PixelFormat::kDepth16, .metres_f32 = true},
};

std::optional<EncodingName> find_encoding(std::string_view name, ImageStream stream) {
  const std::span<const EncodingName> known = stream == ImageStream::kDepth
                                                  ? std::span<const EncodingName>{kDepthEncodings}
                                                  : kColorEncodings;
  for (const EncodingName& encoding : known) {
    if (encoding.name == name) {
      return encoding;
    }
  }
  return std::nullopt;
}

std::string_view name_of(PixelFormat format) {
  for (const EncodingName& encoding : kColorEncodings) {
    if (encoding.format == format) {
      return encoding.name;
    }
  }
  return kDepthEncodings.front().name;
}

const char* name_of(ImageStream stream) {
  return stream == ImageStream::kDepth ? "depth" : "colour";
}

std::vector<std::byte> copy(ros::Bytes bytes) {
  return {bytes.begin(), bytes.end()};
}

}  // namespace

Result<EncodedImage> to_image(const ros::Image& message, ImageStream stream) {
  constexpr std::uint32_t kLargestSide = 1U << 14U;
  const auto encoding = find_encoding(message.encoding, stream);
  if (!encoding) {
    return fail(ErrorCode::kUnsupported, "a {} image with encoding '{}'", name_of(stream),
                message.encoding);
  }
  if (message.width == 0 || message.height == 0 || message.width > kLargestSide ||
      message.height > kLargestSide) {
    return fail(ErrorCode::kInvalidData, "an image of {} x {} pixels", message.width,
                message.height);
  }
  const ImageShape shape{.width = static_cast<int>(message.width),
                         .height = static_cast<int>(message.height),
                         .format = encoding->format};
  const std::size_t row_bytes = encoding->metres_f32
                                    ? static_cast<std::size_t>(message.width) * kFloatBytes
                                    : shape.row_bytes();
  const std::size_t step = message.step == 0 ? row_bytes : message.step;
  // The last row may come without its padding.
  const std::size_t needed = step * (message.height - 1) + row_bytes;
  if (step < row_bytes || message.data.size() < needed) {
    return fail(ErrorCode::kInvalidData,
                "an image of {} x {} {} pixels with {} bytes a row has {} bytes", message.width,
                message.height, message.encoding, message.step, message.data.size());
  }
  return EncodedImage{.stream = stream,
                      .encoding = ImageEncoding::kRaw,
                      .raw = {.shape = shape,
                              .step_bytes = step,
                              .big_endian = message.is_bigendian != 0,
                              .metres_f32 = encoding->metres_f32},
                      .bytes = copy(message.data),
                      .origin = {}};
}

Result<EncodedImage> to_image(const ros::CompressedImage& message, ImageStream stream) {
  // compressed_depth_image_transport: an int32 and two floats, which matter for 32FC1 only, precede
  // the PNG.
  constexpr std::size_t kParameterBytes = 12;
  ros::Bytes data = message.data;
  if (message.format.find("compressedDepth") != std::string::npos) {
    const bool is_png =
        message.format.find("rvl") == std::string::npos && !message.format.starts_with("32FC1");
    if (stream != ImageStream::kDepth || !is_png) {
      return fail(ErrorCode::kUnsupported, "a {} image with format '{}'", name_of(stream),
                  message.format);
    }
    if (data.size() <= kParameterBytes) {
      return fail(ErrorCode::kInvalidData, "a compressed depth image of {} bytes", data.size());
    }
    data = data.subspan(kParameterBytes);
  }
  return EncodedImage{.stream = stream,
                      .encoding = ImageEncoding::kCompressed,
                      .raw = {},
                      .bytes = copy(data),
                      .origin = {}};
}

ros::Image to_message(const FrameRef& frame) {
  const ImageShape& shape = frame.shape();
  ros::Image message;
  message.height = static_cast<std::uint32_t>(shape.height);
  message.width = static_cast<std::uint32_t>(shape.width);
  message.encoding = name_of(shape.format);
  message.step = static_cast<std::uint32_t>(shape.row_bytes());
  message.data = frame.bytes();
  return message;
}

}  // namespace geoflow::drivers::bag
