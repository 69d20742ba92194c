#include <algorithm>
#include <cstddef>
#include <filesystem>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/plot.hpp"

#include "plot/src/axes.hpp"
#include "plot/src/canvas.hpp"

namespace geoflow::tools {
namespace {

constexpr double kMargin = 12;
constexpr double kTitleHeight = 34;
constexpr double kSubtitleHeight = 22;
constexpr TextStyle kTitleText{.size_px = 20, .bold = true};
constexpr TextStyle kSubtitleText{.size_px = 14,
                                  .color = {.red = 0.35, .green = 0.35, .blue = 0.35}};

Result<void> check(const Figure& figure) {
  for (const Axes& axes : figure.axes) {
    for (const Series& series : axes.series) {
      const std::size_t count = series.x.size();
      if (series.y.size() != count || (!series.values.empty() && series.values.size() != count)) {
        return fail(ErrorCode::kInvalidArgument, "plot '{}', series '{}': {} x, {} y and {} values",
                    axes.title, series.label, count, series.y.size(), series.values.size());
      }
    }
  }
  if (figure.columns < 1) {
    return fail(ErrorCode::kInvalidArgument, "plot '{}': {} columns", figure.title, figure.columns);
  }
  return {};
}

void draw(Canvas& canvas, const Figure& figure) {
  double top = kMargin;
  canvas.text(2.0 * kMargin, top, figure.title, {.x = 0, .y = 0}, kTitleText);
  top += kTitleHeight;
  if (!figure.subtitle.empty()) {
    canvas.text(2.0 * kMargin, top, figure.subtitle, {.x = 0, .y = 0}, kSubtitleText);
    top += kSubtitleHeight;
  }
  const auto columns = static_cast<std::size_t>(figure.columns);
  const std::size_t rows = std::max<std::size_t>(1, (figure.axes.size() + columns - 1) / columns);
  const double width = (figure.width_px - 2.0 * kMargin) / static_cast<double>(columns);
  const double height = (figure.height_px - top - kMargin) / static_cast<double>(rows);
  for (std::size_t i = 0; i < figure.axes.size(); ++i) {
    const auto column = static_cast<double>(i % columns);
    const std::size_t row = i / columns;
    draw_axes(canvas, figure.axes[i],
              {.x = kMargin + column * width,
               .y = top + static_cast<double>(row) * height,
               .width = width,
               .height = height});
  }
}

}  // namespace

Result<void> save_figure(const Figure& figure, const std::filesystem::path& path) {
  if (auto checked = check(figure); !checked) {
    return checked;
  }
  return Canvas::create(path, figure.width_px, figure.height_px).and_then([&](Canvas&& canvas) {
    draw(canvas, figure);
    return canvas.finish();
  });
}

}  // namespace geoflow::tools
