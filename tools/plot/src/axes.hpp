#pragma once

#include "geoflow/tools/plot.hpp"

#include "plot/src/canvas.hpp"
#include "plot/src/scale.hpp"

namespace geoflow::tools {

/// Data coordinates to canvas coordinates.
struct Mapping {
  Range x_range;
  Range y_range;
  Box box;

  [[nodiscard]] double x(double value) const noexcept {
    return box.x + (value - x_range.low) / x_range.span() * box.width;
  }
  [[nodiscard]] double y(double value) const noexcept {
    return box.y + box.height - (value - y_range.low) / y_range.span() * box.height;
  }
};

/// Draws one plot with its labels into `cell`. Precondition: lists of equal length in every series.
void draw_axes(Canvas& canvas, const Axes& axes, const Box& cell);

/// Draws labels and samples of the labelled series in the corner of the box where they hide the
/// fewest points.
void draw_legend(Canvas& canvas, const Axes& axes, const Mapping& mapping);

}  // namespace geoflow::tools
