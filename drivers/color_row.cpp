#include "color_row.hpp"

#include <cstddef>
#include <cstring>
#include <span>

#include "geoflow/hal/image.hpp"

namespace geoflow::drivers {
namespace {

std::byte gray_of(std::byte red, std::byte green, std::byte blue) {
  constexpr unsigned kRed = 299;
  constexpr unsigned kGreen = 587;
  constexpr unsigned kBlue = 114;
  constexpr unsigned kSum = kRed + kGreen + kBlue;
  const unsigned sum = kRed * std::to_integer<unsigned>(red) +
                       kGreen * std::to_integer<unsigned>(green) +
                       kBlue * std::to_integer<unsigned>(blue);
  return static_cast<std::byte>((sum + kSum / 2) / kSum);
}

/// Red's place in a pixel; blue has the other end's.
std::size_t place_of_red(PixelFormat format) {
  return format == PixelFormat::kRgb8 ? 0 : 2;
}

}  // namespace

void convert_color_row(PixelFormat source_format, std::span<const std::byte> source,
                       PixelFormat target_format, std::span<std::byte> target) {
  if (source_format == target_format) {
    std::memcpy(target.data(), source.data(), target.size());
    return;
  }
  const std::size_t pixels = target.size() / bytes_per_pixel(target_format);
  const std::size_t step = bytes_per_pixel(source_format);
  const std::size_t source_red = place_of_red(source_format);
  const std::size_t target_red = place_of_red(target_format);
  const bool from_gray = source_format == PixelFormat::kGray8;
  for (std::size_t x = 0; x < pixels; ++x) {
    const std::byte* const pixel = source.data() + x * step;
    const std::byte red = pixel[from_gray ? 0 : source_red];
    const std::byte green = pixel[from_gray ? 0 : 1];
    const std::byte blue = pixel[from_gray ? 0 : 2 - source_red];
    if (target_format == PixelFormat::kGray8) {
      target[x] = gray_of(red, green, blue);
    } else {
      target[3 * x + target_red] = red;
      target[3 * x + 1] = green;
      target[3 * x + 2 - target_red] = blue;
    }
  }
}

}  // namespace geoflow::drivers
