#include "plot/src/axes.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "geoflow/tools/plot.hpp"

#include "plot/src/canvas.hpp"
#include "plot/src/colors.hpp"
#include "plot/src/scale.hpp"

namespace geoflow::tools {
namespace {

// Room around the box [px].
constexpr double kLeft = 78;
constexpr double kRight = 20;
constexpr double kTop = 38;
constexpr double kBottom = 56;
constexpr double kColorBarRoom = 84;
constexpr double kColorBarWidth = 14;
constexpr double kColorBarGap = 14;
constexpr int kColorBarPieces = 128;

// About so far apart [px].
constexpr double kXTickSpacing = 90;
constexpr double kYTickSpacing = 45;
constexpr double kTickLength = 5;
constexpr double kLabelGap = 8;
constexpr double kXLabelDrop = 30;
constexpr double kYLabelShift = 58;
constexpr double kTitleRise = 12;
constexpr double kPadding = 0.05;
/// Room above the largest value where y begins at 0.
constexpr double kHeadRoom = 0.08;

constexpr Stroke kFrameStroke{.color = {.red = 0.35, .green = 0.35, .blue = 0.35}, .width_px = 1};
constexpr Stroke kGridStroke{.color = {.red = 0.90, .green = 0.90, .blue = 0.90}, .width_px = 1};
constexpr TextStyle kTickText{.size_px = 12};
constexpr TextStyle kLabelText{.size_px = 13};
constexpr TextStyle kYLabelText{.size_px = 13, .upwards = true};
constexpr TextStyle kTitleText{.size_px = 15, .bold = true};

bool has_values(const Axes& axes) {
  return std::ranges::any_of(axes.series, [](const Series& s) { return !s.values.empty(); });
}

Range value_range(const Axes& axes) {
  RangeFinder values;
  for (const Series& series : axes.series) {
    std::ranges::for_each(series.values, [&](double value) { values.add(value); });
  }
  return values.range();
}

/// Widens the range whose pixels are the larger ones until both axes have the same scale.
void equalise(Mapping& mapping) {
  const double unit_px = std::min(mapping.box.width / mapping.x_range.span(),
                                  mapping.box.height / mapping.y_range.span());
  const auto widen = [unit_px](Range& range, double side_px) {
    range = padded(range, 0.5 * (side_px / unit_px / range.span() - 1.0));
  };
  widen(mapping.x_range, mapping.box.width);
  widen(mapping.y_range, mapping.box.height);
}

Mapping make_mapping(const Axes& axes, const Box& cell) {
  RangeFinder x;
  RangeFinder y;
  for (const Series& series : axes.series) {
    std::ranges::for_each(series.x, [&](double value) { x.add(value); });
    std::ranges::for_each(series.y, [&](double value) { y.add(value); });
  }
  const double right = kRight + (has_values(axes) ? kColorBarRoom : 0.0);
  Mapping mapping{.x_range = axes.equal_aspect ? padded(x.range(), kPadding) : x.range(),
                  .y_range = padded(y.range(), kPadding),
                  .box = {.x = cell.x + kLeft,
                          .y = cell.y + kTop,
                          .width = std::max(1.0, cell.width - kLeft - right),
                          .height = std::max(1.0, cell.height - kTop - kBottom)}};
  if (axes.y_from_zero && y.range().high > 0) {
    mapping.y_range = {.low = 0, .high = y.range().high * (1.0 + kHeadRoom)};
  }
  if (axes.equal_aspect) {
    equalise(mapping);
  }
  return mapping;
}

int tick_count(double side_px, double spacing_px) {
  return std::max(2, static_cast<int>(side_px / spacing_px));
}

/// With the logarithms of what stands on logarithmic axes; of what is not positive, no number.
Axes with_logarithms(Axes axes) {
  const auto take = [](std::vector<double>& values) {
    std::ranges::transform(values, values.begin(), [](double value) {
      return value > 0 ? std::log10(value) : std::numeric_limits<double>::quiet_NaN();
    });
  };
  for (Series& series : axes.series) {
    if (axes.log_x) {
      take(series.x);
    }
    if (axes.log_y) {
      take(series.y);
    }
  }
  return axes;
}

void draw_frame(Canvas& canvas, const Axes& axes, const Mapping& mapping) {
  const Box& box = mapping.box;
  const double bottom = box.y + box.height;
  const auto on_axis = [](bool log, const Range& range, int count) {
    return log ? decade_ticks(range) : ticks(range, count);
  };
  for (const Tick& tick :
       on_axis(axes.log_x, mapping.x_range, tick_count(box.width, kXTickSpacing))) {
    const double x = mapping.x(tick.value);
    canvas.begin(x, box.y);
    canvas.to(x, bottom);
    canvas.stroke(kGridStroke);
    canvas.begin(x, bottom);
    canvas.to(x, bottom + kTickLength);
    canvas.stroke(kFrameStroke);
    canvas.text(x, bottom + kLabelGap, tick.label, {.x = 0.5, .y = 0}, kTickText);
  }
  for (const Tick& tick :
       on_axis(axes.log_y, mapping.y_range, tick_count(box.height, kYTickSpacing))) {
    const double y = mapping.y(tick.value);
    canvas.begin(box.x, y);
    canvas.to(box.x + box.width, y);
    canvas.stroke(kGridStroke);
    canvas.begin(box.x - kTickLength, y);
    canvas.to(box.x, y);
    canvas.stroke(kFrameStroke);
    canvas.text(box.x - kLabelGap, y, tick.label, {.x = 1, .y = 0.5}, kTickText);
  }
  canvas.text(box.x + 0.5 * box.width, bottom + kXLabelDrop, axes.x_label, {.x = 0.5, .y = 0},
              kLabelText);
  canvas.text(box.x - kYLabelShift, box.y + 0.5 * box.height, axes.y_label, {}, kYLabelText);
  canvas.text(box.x, box.y - kTitleRise, axes.title, {.x = 0, .y = 1}, kTitleText);
}

/// The whole line in one stroke, interrupted where points cannot be drawn.
void draw_plain(Canvas& canvas, const Series& series, const Mapping& mapping) {
  bool down = false;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!drawable(series.x[i]) || !drawable(series.y[i])) {
      down = false;
      continue;
    }
    const double x = mapping.x(series.x[i]);
    const double y = mapping.y(series.y[i]);
    if (down) {
      canvas.to(x, y);
    } else {
      canvas.begin(x, y);
    }
    down = true;
  }
  canvas.stroke({.color = series.color, .width_px = series.width_px, .dashed = series.dashed});
}

/// Piece by piece, each in the colour of the value at its end.
void draw_colored(Canvas& canvas, const Series& series, const Mapping& mapping,
                  const Range& values) {
  for (std::size_t i = 1; i < series.x.size(); ++i) {
    if (!drawable(series.x[i - 1]) || !drawable(series.y[i - 1]) || !drawable(series.x[i]) ||
        !drawable(series.y[i])) {
      continue;
    }
    canvas.begin(mapping.x(series.x[i - 1]), mapping.y(series.y[i - 1]));
    canvas.to(mapping.x(series.x[i]), mapping.y(series.y[i]));
    canvas.stroke({.color = color_map((series.values[i] - values.low) / values.span()),
                   .width_px = series.width_px});
  }
}

void draw_color_bar(Canvas& canvas, const Axes& axes, const Mapping& mapping, const Range& values) {
  const Box bar{.x = mapping.box.x + mapping.box.width + kColorBarGap,
                .y = mapping.box.y,
                .width = kColorBarWidth,
                .height = mapping.box.height};
  const double piece = bar.height / kColorBarPieces;
  for (int i = 0; i < kColorBarPieces; ++i) {
    // One pixel of overlap hides the seams.
    canvas.fill({.x = bar.x,
                 .y = bar.y + i * piece,
                 .width = bar.width,
                 .height = std::min(piece + 1.0, bar.height - i * piece)},
                color_map(1.0 - (i + 0.5) / kColorBarPieces));
  }
  canvas.outline(bar, kFrameStroke);
  for (const Tick& tick : ticks(values, tick_count(bar.height, kYTickSpacing))) {
    const double y = bar.y + bar.height * (1.0 - (tick.value - values.low) / values.span());
    canvas.text(bar.x + bar.width + kLabelGap, y, tick.label, {.x = 0, .y = 0.5}, kTickText);
  }
  canvas.text(bar.x + kColorBarRoom - 2.0 * kColorBarGap, bar.y + 0.5 * bar.height,
              axes.value_label, {}, kYLabelText);
}

}  // namespace

void draw_axes(Canvas& canvas, const Axes& given, const Box& cell) {
  const Axes axes = with_logarithms(given);
  const Mapping mapping = make_mapping(axes, cell);
  const Range values = value_range(axes);
  draw_frame(canvas, axes, mapping);
  canvas.clip(mapping.box);
  for (const Series& series : axes.series) {
    if (series.values.empty()) {
      draw_plain(canvas, series, mapping);
    } else {
      draw_colored(canvas, series, mapping, values);
    }
  }
  canvas.unclip();
  canvas.outline(mapping.box, kFrameStroke);
  if (has_values(axes)) {
    draw_color_bar(canvas, axes, mapping, values);
  }
  draw_legend(canvas, axes, mapping);
}

}  // namespace geoflow::tools
