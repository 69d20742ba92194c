#include "src/image_packer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"

#include "src/image_view.hpp"
#include "src/stream_table.hpp"

namespace geoflow::emulator {
namespace {

constexpr std::uint8_t kNoColor = 128;

struct Rgb {
  int r = 0;
  int g = 0;
  int b = 0;
};

struct Yuv {
  std::uint8_t y = 0;
  std::uint8_t u = kNoColor;
  std::uint8_t v = kNoColor;
};

// NOLINTBEGIN(readability-magic-numbers): the integer matrices of ITU-R BT.601, in 1/256

/// Video range, as the camera's colour is.
Yuv to_yuv(const Rgb& c) {
  return {.y = static_cast<std::uint8_t>(((66 * c.r + 129 * c.g + 25 * c.b + 128) >> 8) + 16),
          .u = static_cast<std::uint8_t>(((-38 * c.r - 74 * c.g + 112 * c.b + 128) >> 8) + 128),
          .v = static_cast<std::uint8_t>(((112 * c.r - 94 * c.g - 18 * c.b + 128) >> 8) + 128)};
}

/// Full range, as the imagers' gray is.
std::uint8_t to_gray(const Rgb& c) {
  return static_cast<std::uint8_t>((77 * c.r + 150 * c.g + 29 * c.b + 128) >> 8);
}

Rgb to_rgb(const Yuv& c) {
  const int y = 298 * (c.y - 16);
  const int u = c.u - 128;
  const int v = c.v - 128;
  const auto clamped = [](int value) { return std::clamp((value + 128) >> 8, 0, 255); };
  return {
      .r = clamped(y + 409 * v), .g = clamped(y - 100 * u - 208 * v), .b = clamped(y + 516 * u)};
}

// NOLINTEND(readability-magic-numbers)

/// The colour of one pixel of an image of any format.
template <PixelFormat Format>
Rgb color_at(const std::uint8_t* pixels, std::size_t index) {
  if constexpr (Format == PixelFormat::kGray8) {
    return {.r = pixels[index], .g = pixels[index], .b = pixels[index]};
  } else if constexpr (Format == PixelFormat::kYuyv) {
    const std::uint8_t* pair = pixels + 4 * (index / 2);
    return to_rgb({.y = pixels[2 * index], .u = pair[1], .v = pair[3]});
  } else {
    const std::uint8_t* pixel = pixels + 3 * index;
    constexpr bool kBlueFirst = Format == PixelFormat::kBgr8;
    return {.r = pixel[kBlueFirst ? 2 : 0], .g = pixel[1], .b = pixel[kBlueFirst ? 0 : 2]};
  }
}

/// Calls `use(pixel, colour)` for each pixel of the view, in order.
template <PixelFormat Format, typename Use>
void for_each_color_of(const PixelMap& map, const FrameRef& image, const Use& use) {
  const auto* pixels = image.row<std::uint8_t>(0);
  for (std::size_t i = 0; i < map.size(); ++i) {
    const std::int32_t source = map[i];
    use(i, source == PixelMap::kOutside
               ? Rgb{}
               : color_at<Format>(pixels, static_cast<std::size_t>(source)));
  }
}

template <typename Use>
void for_each_color(const PixelMap& map, const FrameRef& image, const Use& use) {
  if (!image) {
    for (std::size_t i = 0; i < map.size(); ++i) {
      use(i, Rgb{});
    }
    return;
  }
  switch (image.shape().format) {
    case PixelFormat::kRgb8:
      return for_each_color_of<PixelFormat::kRgb8>(map, image, use);
    case PixelFormat::kBgr8:
      return for_each_color_of<PixelFormat::kBgr8>(map, image, use);
    case PixelFormat::kYuyv:
      return for_each_color_of<PixelFormat::kYuyv>(map, image, use);
    default:
      return for_each_color_of<PixelFormat::kGray8>(map, image, use);
  }
}

std::vector<std::uint16_t> depth_of(const PixelMap& map, const FrameRef& image) {
  std::vector<std::uint16_t> depth(map.size());
  if (image) {
    const auto* pixels = image.row<std::uint16_t>(0);
    for (std::size_t i = 0; i < map.size(); ++i) {
      depth[i] = map[i] == PixelMap::kOutside ? std::uint16_t{0} : pixels[map[i]];
    }
  }
  return depth;
}

std::vector<std::uint8_t> gray_of(const PixelMap& map, const FrameRef& image) {
  std::vector<std::uint8_t> gray(map.size());
  for_each_color(map, image, [&](std::size_t i, const Rgb& color) { gray[i] = to_gray(color); });
  return gray;
}

/// The left image as the right imager sees it. `disparity_depth`: focal length times baseline, in
/// pixels times depth counts. Of what falls on one pixel the nearest stays; what only the right
/// imager sees takes its left neighbour's gray.
std::vector<std::uint8_t> right_of(const std::vector<std::uint8_t>& left,
                                   const std::vector<std::uint16_t>& depth, std::size_t width,
                                   double disparity_depth) {
  std::vector<std::uint8_t> right(left.size());
  constexpr int kNothing = -1;
  std::vector<int> shift(width);
  for (std::size_t row = 0; row < left.size(); row += width) {
    std::ranges::fill(shift, kNothing);
    for (std::size_t x = 0; x < width; ++x) {
      const std::uint16_t z = depth[row + x];
      const auto disparity =
          z == 0 ? std::size_t{0} : static_cast<std::size_t>(std::lround(disparity_depth / z));
      if (disparity <= x && static_cast<int>(disparity) > shift[x - disparity]) {
        shift[x - disparity] = static_cast<int>(disparity);
        right[row + x - disparity] = left[row + x];
      }
    }
    for (std::size_t x = 1; x < width; ++x) {
      right[row + x] = shift[x] == kNothing ? right[row + x - 1] : right[row + x];
    }
  }
  return right;
}

void pack_yuyv(const PixelMap& map, const FrameRef& image, ByteWriter& to) {
  if (image && map.identity() && image.shape().format == PixelFormat::kYuyv) {
    to.bytes(image.bytes());
    return;
  }
  // The chroma of a pair is that of its left pixel, as one that is between the two belongs to
  // neither.
  std::vector<std::uint8_t> bytes(2 * map.size());
  for_each_color(map, image, [&](std::size_t i, const Rgb& color) {
    const Yuv yuv = to_yuv(color);
    bytes[2 * i] = yuv.y;
    if (i % 2 == 0) {
      bytes[2 * i + 1] = yuv.u;
      bytes[2 * i + 3] = yuv.v;
    }
  });
  to.bytes(bytes);
}

void pack_uyvy(const std::vector<std::uint8_t>& gray, ByteWriter& to) {
  std::vector<std::uint8_t> bytes(2 * gray.size(), kNoColor);
  for (std::size_t i = 0; i < gray.size(); ++i) {
    bytes[2 * i + 1] = gray[i];
  }
  to.bytes(bytes);
}

void pack_bayer(const PixelMap& map, const FrameRef& image, ByteWriter& to) {
  constexpr unsigned kTenBits = 2;  // more than eight
  std::vector<std::uint16_t> mosaic(map.size());
  const auto width = static_cast<std::size_t>(map.width());
  for_each_color(map, image, [&](std::size_t i, const Rgb& color) {
    const bool odd_row = (i / width) % 2 != 0;
    const bool odd_column = (i % width) % 2 != 0;
    const int value = odd_row == odd_column ? (odd_row ? color.b : color.r) : color.g;
    mosaic[i] = static_cast<std::uint16_t>(value << kTenBits);
  });
  to.bytes(std::as_bytes(std::span{mosaic}));
}

void pack_pair(const std::vector<std::uint8_t>& left, const std::vector<std::uint8_t>& right,
               bool twelve_bits, ByteWriter& to) {
  constexpr unsigned kNibble = 4;
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (twelve_bits) {
      const unsigned r = unsigned{right[i]} << kNibble;
      const unsigned l = unsigned{left[i]} << kNibble;
      to.put(static_cast<std::uint8_t>(r))
          .put(static_cast<std::uint8_t>((r >> 8U) | (l << kNibble)));
      to.put(static_cast<std::uint8_t>(l >> kNibble));
    } else {
      to.put(left[i]).put(right[i]);
    }
  }
}

}  // namespace

ImagePacker::ImagePacker(const CameraIntrinsics& source, Packing packing, const FrameSize& size)
    : packing_{packing} {
  const CameraIntrinsics view = view_of(source, size.width, size.height);
  fx_px_ = view.fx;
  map_ = PixelMap{source, view};
}

void ImagePacker::pack(const ColorFrame& color, const DepthFrame& depth, double depth_unit_m,
                       ByteWriter& to) const {
  switch (packing_) {
    case Packing::kDepth:
      if (depth.image && map_.identity()) {
        to.bytes(depth.image.bytes());
      } else {
        const auto pixels = depth_of(map_, depth.image);
        to.bytes(std::as_bytes(std::span{pixels}));
      }
      break;
    case Packing::kGray:
      to.bytes(gray_of(map_, color.image));
      break;
    case Packing::kUyvy:
      pack_uyvy(gray_of(map_, color.image), to);
      break;
    case Packing::kGrayPair:
    case Packing::kGrayPair12: {
      const auto left = gray_of(map_, color.image);
      const auto right =
          right_of(left, depth_of(map_, depth.image), static_cast<std::size_t>(map_.width()),
                   fx_px_ * kBaselineM / depth_unit_m);
      pack_pair(left, right, packing_ == Packing::kGrayPair12, to);
      break;
    }
    case Packing::kYuyv:
      pack_yuyv(map_, color.image, to);
      break;
    case Packing::kBayer:
      pack_bayer(map_, color.image, to);
      break;
  }
}

}  // namespace geoflow::emulator
