#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "geoflow/tools/plot.hpp"

#include "plot/src/axes.hpp"
#include "plot/src/canvas.hpp"
#include "plot/src/colors.hpp"

namespace geoflow::tools {
namespace {

constexpr TextStyle kText{.size_px = 12};
constexpr double kLine = 19;    ///< height of one entry [px]
constexpr double kSample = 26;  ///< length of the line beside a label [px]
constexpr double kGap = 8;      ///< between sample, label and border [px]
constexpr double kMargin = 10;  ///< to the plot's frame [px]
constexpr double kOpacity = 0.85;
constexpr Stroke kBorder{.color = {.red = 0.8, .green = 0.8, .blue = 0.8}, .width_px = 1};
constexpr int kColoredPieces = 8;

std::size_t points_in(const Box& box, const Axes& axes, const Mapping& mapping) {
  std::size_t count = 0;
  for (const Series& series : axes.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      const double x = mapping.x(series.x[i]);
      const double y = mapping.y(series.y[i]);
      if (x >= box.x && x <= box.x + box.width && y >= box.y && y <= box.y + box.height) {
        ++count;
      }
    }
  }
  return count;
}

/// Top right, top left, bottom right or bottom left: the first of those with the fewest points.
Box best_place(double width, double height, const Axes& axes, const Mapping& mapping) {
  const Box& frame = mapping.box;
  const double left = frame.x + kMargin;
  const double right = frame.x + frame.width - kMargin - width;
  const double top = frame.y + kMargin;
  const double bottom = frame.y + frame.height - kMargin - height;
  const std::array<Box, 4> places{{{.x = right, .y = top, .width = width, .height = height},
                                   {.x = left, .y = top, .width = width, .height = height},
                                   {.x = right, .y = bottom, .width = width, .height = height},
                                   {.x = left, .y = bottom, .width = width, .height = height}}};
  return *std::ranges::min_element(
      places, {}, [&](const Box& place) { return points_in(place, axes, mapping); });
}

void draw_sample(Canvas& canvas, const Series& series, double x, double y) {
  if (series.values.empty()) {
    canvas.begin(x, y);
    canvas.to(x + kSample, y);
    canvas.stroke({.color = series.color, .width_px = series.width_px, .dashed = series.dashed});
    return;
  }
  const double piece = kSample / kColoredPieces;
  for (int i = 0; i < kColoredPieces; ++i) {
    canvas.begin(x + i * piece, y);
    canvas.to(x + (i + 1) * piece, y);
    canvas.stroke({.color = color_map((i + 0.5) / kColoredPieces), .width_px = series.width_px});
  }
}

}  // namespace

void draw_legend(Canvas& canvas, const Axes& axes, const Mapping& mapping) {
  std::vector<const Series*> entries;
  double label_width = 0;
  for (const Series& series : axes.series) {
    if (!series.label.empty()) {
      entries.push_back(&series);
      label_width = std::max(label_width, canvas.text_width(series.label, kText));
    }
  }
  if (entries.empty()) {
    return;
  }
  constexpr double kGaps = 3;  // before, between and after sample and label
  const double width = kSample + label_width + kGaps * kGap;
  const double height = kLine * static_cast<double>(entries.size()) + kGap;
  const Box place = best_place(width, height, axes, mapping);
  canvas.fill(place, {.red = 1, .green = 1, .blue = 1}, kOpacity);
  canvas.outline(place, kBorder);
  double y = place.y + 0.5 * (kGap + kLine);
  for (const Series* series : entries) {
    draw_sample(canvas, *series, place.x + kGap, y);
    canvas.text(place.x + 2.0 * kGap + kSample, y, series->label, {.x = 0, .y = 0.5}, kText);
    y += kLine;
  }
}

}  // namespace geoflow::tools
