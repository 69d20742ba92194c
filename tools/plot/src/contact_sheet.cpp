#include "geoflow/tools/contact_sheet.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

#include "plot/src/canvas.hpp"
#include "plot/src/colors.hpp"

namespace geoflow::tools {
namespace {

constexpr double kGap = 8;
constexpr double kCaptionHeight = 22;
constexpr double kBrightest = 255;

Color gray(double value) {
  return {.red = value, .green = value, .blue = value};
}

/// The colour of one pixel.
Color color_at(const FrameRef& image, int x, int y, const SheetOptions& options) {
  const auto column = static_cast<std::size_t>(x);
  switch (image.shape().format) {
    case PixelFormat::kGray8:
      return gray(image.row<std::uint8_t>(y)[column] / kBrightest);
    case PixelFormat::kDepth16: {
      const std::uint16_t counts = image.row<std::uint16_t>(y)[column];
      return counts == 0 ? gray(0)
                         : color_map(counts * options.depth_unit_m / options.depth_range_m);
    }
    default: {
      const std::uint8_t* pixel = image.row<std::uint8_t>(y) + 3 * column;
      const Color color{.red = pixel[0] / kBrightest,
                        .green = pixel[1] / kBrightest,
                        .blue = pixel[2] / kBrightest};
      return image.shape().format == PixelFormat::kRgb8
                 ? color
                 : Color{.red = color.blue, .green = color.green, .blue = color.red};
    }
  }
}

/// Pixels of an image, right and bottom not included.
struct Area {
  int left;
  int top;
  int right;
  int bottom;
};

Color mean_color(const FrameRef& image, const Area& area, const SheetOptions& options) {
  Color sum;
  for (int v = area.top; v < area.bottom; ++v) {
    for (int u = area.left; u < area.right; ++u) {
      const Color one = color_at(image, u, v, options);
      sum.red += one.red;
      sum.green += one.green;
      sum.blue += one.blue;
    }
  }
  const double count = (area.right - area.left) * (area.bottom - area.top);
  return {.red = sum.red / count, .green = sum.green / count, .blue = sum.blue / count};
}

/// The image at the tile's width, each pixel the mean of what it covers; depth, which has no mean
/// over an edge, the pixel in the middle.
std::vector<Color> scaled(const FrameRef& image, int width, int height,
                          const SheetOptions& options) {
  const ImageShape& shape = image.shape();
  const bool depth = shape.format == PixelFormat::kDepth16;
  std::vector<Color> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int left = x * shape.width / width;
      const int top = y * shape.height / height;
      const int right = depth ? left + 1 : std::max(left + 1, (x + 1) * shape.width / width);
      const int bottom = depth ? top + 1 : std::max(top + 1, (y + 1) * shape.height / height);
      pixels.push_back(
          mean_color(image, {.left = left, .top = top, .right = right, .bottom = bottom}, options));
    }
  }
  return pixels;
}

Result<void> check(const std::vector<SheetImage>& images, const SheetOptions& options) {
  if (options.columns < 1 || options.tile_width_px < 1 || !(options.depth_range_m > 0)) {
    return fail(ErrorCode::kInvalidArgument, "a contact sheet of {} columns of {} px",
                options.columns, options.tile_width_px);
  }
  for (const SheetImage& one : images) {
    if (!one.image || one.image.shape().width < 1 || one.image.shape().height < 1 ||
        one.image.shape().format == PixelFormat::kYuyv) {
      return fail(ErrorCode::kInvalidArgument, "contact sheet, '{}': no image that can be drawn",
                  one.caption);
    }
  }
  return {};
}

}  // namespace

Result<void> save_contact_sheet(const std::vector<SheetImage>& images, const SheetOptions& options,
                                const std::filesystem::path& path) {
  if (auto checked = check(images, options); !checked) {
    return checked;
  }
  int tile_height = 1;
  for (const SheetImage& one : images) {
    const ImageShape& shape = one.image.shape();
    tile_height = std::max(tile_height, options.tile_width_px * shape.height / shape.width);
  }
  const int columns = std::min(options.columns, std::max(1, static_cast<int>(images.size())));
  const int rows = (static_cast<int>(images.size()) + columns - 1) / columns;
  const double step_x = options.tile_width_px + kGap;
  const double step_y = tile_height + kCaptionHeight + kGap;
  return Canvas::create(path, static_cast<int>(columns * step_x + kGap),
                        static_cast<int>(rows * step_y + kGap))
      .and_then([&](Canvas&& canvas) {
        for (int i = 0; i < static_cast<int>(images.size()); ++i) {
          const SheetImage& one = images[static_cast<std::size_t>(i)];
          const int column = i % columns;
          const int row = i / columns;
          const double x = kGap + column * step_x;
          const double y = kGap + row * step_y;
          const ImageShape& shape = one.image.shape();
          const int height = std::max(1, options.tile_width_px * shape.height / shape.width);
          canvas.pixels(x, y, options.tile_width_px,
                        scaled(one.image, options.tile_width_px, height, options));
          canvas.text(x, y + tile_height + 2, one.caption, {.x = 0, .y = 0}, {});
        }
        return canvas.finish();
      });
}

}  // namespace geoflow::tools
