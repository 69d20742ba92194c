#include "plot/src/canvas.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <cairo-svg.h>
#include <cairo.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {
namespace {

constexpr int kMinSidePx = 100;
constexpr int kMaxSidePx = 10'000;
constexpr std::array<double, 2> kDashesPx{6.0, 4.0};

tl::unexpected<Error> failed(const std::filesystem::path& path, cairo_status_t status) {
  return fail(ErrorCode::kSystem, "{}: {}", path.string(), cairo_status_to_string(status));
}

void set_color(cairo_t* context, const Color& color, double opacity) {
  cairo_set_source_rgba(context, color.red, color.green, color.blue, opacity);
}

}  // namespace

void Canvas::Destroy::operator()(cairo_t* context) const noexcept {
  cairo_destroy(context);
}
void Canvas::Destroy::operator()(cairo_surface_t* surface) const noexcept {
  cairo_surface_destroy(surface);
}

Result<Canvas> Canvas::create(const std::filesystem::path& path, int width_px, int height_px) {
  const bool png = path.extension() == ".png";
  if (!png && path.extension() != ".svg") {
    return fail(ErrorCode::kInvalidArgument, "{}: a plot's name must end with .png or .svg",
                path.string());
  }
  if (width_px < kMinSidePx || width_px > kMaxSidePx || height_px < kMinSidePx ||
      height_px > kMaxSidePx) {
    return fail(ErrorCode::kInvalidArgument, "a plot of {} x {} px: each side must be {} to {} px",
                width_px, height_px, kMinSidePx, kMaxSidePx);
  }
  Canvas canvas;
  canvas.path_ = path;
  canvas.png_ = png;
  canvas.surface_.reset(png ? cairo_image_surface_create(CAIRO_FORMAT_RGB24, width_px, height_px)
                            : cairo_svg_surface_create(path.c_str(), width_px, height_px));
  if (const auto status = cairo_surface_status(canvas.surface_.get());
      status != CAIRO_STATUS_SUCCESS) {
    return failed(path, status);
  }
  canvas.context_.reset(cairo_create(canvas.surface_.get()));
  cairo_set_line_join(canvas.context_.get(), CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_cap(canvas.context_.get(), CAIRO_LINE_CAP_ROUND);
  canvas.fill({.width = static_cast<double>(width_px), .height = static_cast<double>(height_px)},
              {.red = 1, .green = 1, .blue = 1});
  return canvas;
}

void Canvas::choose(const TextStyle& style) {
  cairo_select_font_face(context_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), style.size_px);
}

void Canvas::text(double x, double y, const std::string& text, const Anchor& anchor,
                  const TextStyle& style) {
  choose(style);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), text.c_str(), &extents);
  cairo_font_extents_t font;
  cairo_font_extents(context_.get(), &font);
  cairo_save(context_.get());
  cairo_translate(context_.get(), x, y);
  if (style.upwards) {
    cairo_rotate(context_.get(), -0.5 * std::numbers::pi);
  }
  // The font's height, not the text's, so that labels side by side share a base line.
  cairo_move_to(context_.get(), -anchor.x * extents.x_advance,
                font.ascent - anchor.y * (font.ascent + font.descent));
  set_color(context_.get(), style.color, 1.0);
  cairo_show_text(context_.get(), text.c_str());
  cairo_restore(context_.get());
  cairo_new_path(context_.get());
}

double Canvas::text_width(const std::string& text, const TextStyle& style) {
  choose(style);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::begin(double x, double y) {
  cairo_move_to(context_.get(), x, y);
}

void Canvas::to(double x, double y) {
  cairo_line_to(context_.get(), x, y);
}

void Canvas::stroke(const Stroke& stroke) {
  set_color(context_.get(), stroke.color, 1.0);
  cairo_set_line_width(context_.get(), stroke.width_px);
  cairo_set_dash(context_.get(), kDashesPx.data(), stroke.dashed ? kDashesPx.size() : 0, 0.0);
  cairo_stroke(context_.get());
}

void Canvas::fill(const Box& box, const Color& color, double opacity) {
  set_color(context_.get(), color, opacity);
  cairo_rectangle(context_.get(), box.x, box.y, box.width, box.height);
  cairo_fill(context_.get());
}

void Canvas::outline(const Box& box, const Stroke& line) {
  cairo_rectangle(context_.get(), box.x, box.y, box.width, box.height);
  stroke(line);
}

void Canvas::pixels(double x, double y, int width, const std::vector<Color>& picture) {
  constexpr double kBrightest = 255;
  const auto byte = [](double value) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0, 1.0) * kBrightest));
  };
  std::vector<std::uint32_t> values;  // CAIRO_FORMAT_RGB24: red in bits 16 to 23
  values.reserve(picture.size());
  for (const Color& color : picture) {
    values.push_back(byte(color.red) << 16U | byte(color.green) << 8U | byte(color.blue));
  }
  const int height = static_cast<int>(picture.size()) / width;
  void* const memory = values.data();
  const std::unique_ptr<cairo_surface_t, Destroy> image{cairo_image_surface_create_for_data(
      static_cast<unsigned char*>(memory), CAIRO_FORMAT_RGB24, width, height,
      width * static_cast<int>(sizeof(std::uint32_t)))};
  cairo_set_source_surface(context_.get(), image.get(), x, y);
  cairo_rectangle(context_.get(), x, y, width, height);
  cairo_fill(context_.get());
  cairo_set_source_rgb(context_.get(), 0, 0, 0);  // lets go of the image, whose pixels go now
  cairo_surface_finish(image.get());
}

void Canvas::clip(const Box& box) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), box.x, box.y, box.width, box.height);
  cairo_clip(context_.get());
}

void Canvas::unclip() {
  cairo_restore(context_.get());
}

Result<void> Canvas::finish() {
  cairo_status_t status = cairo_status(context_.get());
  if (status == CAIRO_STATUS_SUCCESS && png_) {
    status = cairo_surface_write_to_png(surface_.get(), path_.c_str());
  }
  cairo_surface_finish(surface_.get());
  if (status == CAIRO_STATUS_SUCCESS) {
    status = cairo_surface_status(surface_.get());
  }
  if (status != CAIRO_STATUS_SUCCESS) {
    return failed(path_, status);
  }
  return {};
}

}  // namespace geoflow::tools
