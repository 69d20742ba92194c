#include "d435i/pixels/yuyv.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {
namespace {

// BT.601 with luma on 16 to 235 (ITU-R BT.601-7, 2.5), in units of 2^-16.
constexpr int kShift = 16;
constexpr int kHalf = 1 << (kShift - 1);
constexpr int kLumaOffset = 16;
constexpr int kChromaOffset = 128;
constexpr int kLuma = 76309;        // 255 / 219
constexpr int kRedFromV = 104597;   // 1.402 * 255 / 224
constexpr int kGreenFromU = 25675;  // 0.344136 * 255 / 224
constexpr int kGreenFromV = 53279;  // 0.714136 * 255 / 224
constexpr int kBlueFromU = 132201;  // 1.772 * 255 / 224

constexpr std::size_t kPairBytes = 4;  // Y0 U Y1 V
constexpr std::size_t kColorPairBytes = 6;

void to_gray(const std::uint8_t* source, std::size_t pixels, std::uint8_t* target) {
  for (std::size_t i = 0; i < pixels; ++i) {
    target[i] = source[2 * i];
  }
}

std::uint8_t clamped(int value) {
  constexpr int kLargest = 255;
  return static_cast<std::uint8_t>(std::clamp(value >> kShift, 0, kLargest));
}

/// `kRed` is red's place in a pixel, 0 or 2; blue has the other.
template <std::size_t kRed>
void to_color(const std::uint8_t* source, std::size_t pixels, std::uint8_t* target) {
  for (std::size_t pair = 0; pair < pixels / 2; ++pair) {
    const std::uint8_t* yuyv = source + pair * kPairBytes;
    std::uint8_t* pixel = target + pair * kColorPairBytes;
    const int u = yuyv[1] - kChromaOffset;
    const int v = yuyv[3] - kChromaOffset;
    const int blue = kBlueFromU * u + kHalf;
    const int green = -kGreenFromU * u - kGreenFromV * v + kHalf;
    const int red = kRedFromV * v + kHalf;
    for (int i = 0; i < 2; ++i, pixel += 3) {
      const int luma = kLuma * (yuyv[2 * i] - kLumaOffset);
      pixel[2 - kRed] = clamped(luma + blue);
      pixel[1] = clamped(luma + green);
      pixel[kRed] = clamped(luma + red);
    }
  }
}

}  // namespace

Result<void> convert_yuyv(std::span<const std::byte> source, const ImageShape& shape,
                          std::span<std::byte> target) {
  const ImageShape yuyv{.width = shape.width, .height = shape.height, .format = PixelFormat::kYuyv};
  if (source.size() != yuyv.size_bytes() || shape.width % 2 != 0) {
    return fail(ErrorCode::kInvalidData, "{} bytes of YUYV where {}x{} has {}", source.size(),
                shape.width, shape.height, yuyv.size_bytes());
  }
  const std::size_t pixels = source.size() / 2;
  // NOLINTBEGIN(cppcoreguidelines-pro-type-reinterpret-cast): bytes as numbers
  const auto* const from = reinterpret_cast<const std::uint8_t*>(source.data());
  auto* const to = reinterpret_cast<std::uint8_t*>(target.data());
  // NOLINTEND(cppcoreguidelines-pro-type-reinterpret-cast)
  if (shape.format == PixelFormat::kGray8) {
    to_gray(from, pixels, to);
  } else if (shape.format == PixelFormat::kBgr8) {
    to_color<2>(from, pixels, to);
  } else if (shape.format == PixelFormat::kRgb8) {
    to_color<0>(from, pixels, to);
  } else {
    return fail(ErrorCode::kUnsupported, "YUYV becomes gray, BGR or RGB only");
  }
  return {};
}

}  // namespace geoflow::drivers::d435i
