#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"

/// Figures for reports: a grid of axes with lines, as PNG or SVG, or as data for a page's script
/// that draws them. Plain values in, a file or data out.
namespace geoflow::tools {

/// Red, green, blue, each 0 to 1.
struct Color {
  double red = 0;
  double green = 0;
  double blue = 0;
};

/// Colours for successive series, told apart also by people who cannot tell red from green (M.
/// Okabe, K. Ito, "Color universal design", 2008): blue, vermilion, green, purple, sky blue.
inline constexpr std::array<Color, 5> kSeriesColors{{{.red = 0.00, .green = 0.45, .blue = 0.70},
                                                     {.red = 0.84, .green = 0.37, .blue = 0.00},
                                                     {.red = 0.00, .green = 0.62, .blue = 0.45},
                                                     {.red = 0.80, .green = 0.47, .blue = 0.65},
                                                     {.red = 0.34, .green = 0.71, .blue = 0.91}}};
/// For what others are compared with.
inline constexpr Color kReferenceColor{.red = 0.55, .green = 0.55, .blue = 0.55};

/// One line through points, in the units of its axes. Points with a coordinate that is not finite
/// interrupt the line.
struct Series {
  std::string label;  ///< in the legend; empty: not there
  std::vector<double> x;
  std::vector<double> y;  ///< as many as x
  Color color = kSeriesColors[0];
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double width_px = 1.6;
  bool dashed = false;
  /// As many as x, or empty: each piece of the line is coloured by its value on the axes' colour
  /// bar.
  std::vector<double> values{};
};

/// One plot: a box with ticks and labels. Its range is what the series need.
struct Axes {
  std::string title;
  std::string x_label;  ///< with the unit: "time (s)"
  std::string y_label;
  std::string value_label{};  ///< of the colour bar, which is drawn where some series has values
  bool equal_aspect = false;  ///< a metre is as long to the right as upwards
  bool y_from_zero = false;   ///< the range of y begins at 0: for errors
  bool log_x = false;         ///< logarithmic: what is not positive is not drawn
  bool log_y = false;
  std::vector<Series> series{};
};

/// Axes in a grid, row by row.
struct Figure {
  std::string title;
  std::string subtitle{};  ///< smaller, below the title
  int columns = 2;
  // NOLINTBEGIN(readability-magic-numbers): named by the members
  int width_px = 1400;
  int height_px = 1050;
  // NOLINTEND(readability-magic-numbers)
  std::vector<Axes> axes{};
};

/// Draws to `path`, whose ending decides: `.png` or `.svg`. The same figure gives the same pixels.
/// Thread-safe. Errors: another ending, a size outside 100 to 10000 px, series whose lists differ
/// in length, a file that cannot be written.
[[nodiscard]] Result<void> save_figure(const Figure& figure, const std::filesystem::path& path);

/// The figure for a script that draws it: `columns`, and of each of `axes` its `title`, `x_label`,
/// `y_label`, `value_label`, `equal`, `from_zero` and `series` (`label`, `color`, `width`,
/// `dashed`, `x`, `y`, and where there are any `values`). Numbers have six digits, those that
/// cannot be drawn are null. Of a long series only those points are left that its picture, 1000
/// pixels wide, needs (U. Jugel et al., "M4: A Visualization-Oriented Time Series Data
/// Aggregation", VLDB 2014): of a thousandth of it the first, the last, and those furthest out.
/// Pure. Precondition: no axis is logarithmic, lists of equal length in every series.
[[nodiscard]] nlohmann::json to_json(const Figure& figure);

/// The colours of `values` in save_figure(), from least to largest, evenly spaced.
[[nodiscard]] nlohmann::json color_map_json();

}  // namespace geoflow::tools
