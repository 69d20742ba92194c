#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

// Cairo's handles, so that only canvas.cpp sees its header.
using cairo_t = struct _cairo;  // NOLINT(bugprone-reserved-identifier): Cairo's name
using cairo_surface_t =
    struct _cairo_surface;  // NOLINT(bugprone-reserved-identifier): Cairo's name

namespace geoflow::tools {

/// A rectangle on the canvas [px]; y grows downwards.
struct Box {
  double x = 0;
  double y = 0;
  double width = 0;
  double height = 0;
};

/// Where a text's anchor lies in it: 0 left or top, 0.5 middle, 1 right or bottom.
struct Anchor {
  double x = 0.5;
  double y = 0.5;
};

// NOLINTBEGIN(readability-magic-numbers): each default is named by its member
struct TextStyle {
  double size_px = 13;
  bool bold = false;
  bool upwards = false;  ///< turned to be read from bottom to top
  Color color{.red = 0.15, .green = 0.15, .blue = 0.15};
};
// NOLINTEND(readability-magic-numbers)

struct Stroke {
  Color color;
  double width_px = 1;
  bool dashed = false;
};

/// A white sheet to draw on. Thread-bound.
class Canvas {
 public:
  /// Errors: as save_figure().
  [[nodiscard]] static Result<Canvas> create(const std::filesystem::path& path, int width_px,
                                             int height_px);

  void text(double x, double y, const std::string& text, const Anchor& anchor,
            const TextStyle& style);
  [[nodiscard]] double text_width(const std::string& text, const TextStyle& style);

  /// A line as a path: begin, any number of to, then stroke.
  void begin(double x, double y);
  void to(double x, double y);
  void stroke(const Stroke& stroke);

  void fill(const Box& box, const Color& color, double opacity = 1.0);
  void outline(const Box& box, const Stroke& stroke);

  /// A picture of `width` columns, row by row, one unit a pixel; (x, y) is its upper left corner.
  void pixels(double x, double y, int width, const std::vector<Color>& picture);

  /// Until unclip(), only what lies in the box is drawn. Not nested.
  void clip(const Box& box);
  void unclip();

  /// Writes the file. Call once, last.
  [[nodiscard]] Result<void> finish();

 private:
  struct Destroy {
    void operator()(cairo_t* context) const noexcept;
    void operator()(cairo_surface_t* surface) const noexcept;
  };
  Canvas() = default;
  void choose(const TextStyle& style);

  std::filesystem::path path_;
  bool png_ = false;
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> context_;  // goes before its surface
};

}  // namespace geoflow::tools
