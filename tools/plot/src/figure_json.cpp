#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/tools/plot.hpp"

#include "plot/src/colors.hpp"
#include "plot/src/scale.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr std::size_t kPieces = 1000;   ///< of a long series
constexpr std::size_t kLongest = 5000;  ///< points that are all kept
constexpr std::size_t kColorSteps = 64;

json number(double value) {
  return drawable(value) ? json::parse(fmt::format("{:.6g}", value)) : json{};
}

json numbers(const std::vector<double>& values, const std::vector<std::size_t>& which) {
  json list = json::array();
  for (const std::size_t i : which) {
    list.push_back(number(values[i]));
  }
  return list;
}

json to_json(const Color& color) {
  return {number(color.red), number(color.green), number(color.blue)};
}

bool seen(const Series& series, std::size_t i) {
  return drawable(series.x[i]) && drawable(series.y[i]);
}

/// The points of [begin, end) that a picture needs: first, last, those furthest out, and one that
/// interrupts the line.
std::vector<std::size_t> piece_points(const Series& series, std::size_t begin, std::size_t end) {
  const auto furthest = [&](const std::vector<double>& list, double sign) {
    std::size_t best = end;
    for (std::size_t i = begin; i < end; ++i) {
      if (seen(series, i) && (best == end || sign * list[i] > sign * list[best])) {
        best = i;
      }
    }
    return best;
  };
  std::size_t gap = begin;
  while (gap < end && seen(series, gap)) {
    ++gap;
  }
  std::vector<std::size_t> piece{begin,
                                 end - 1,
                                 furthest(series.x, 1),
                                 furthest(series.x, -1),
                                 furthest(series.y, 1),
                                 furthest(series.y, -1),
                                 gap};
  std::ranges::sort(piece);
  piece.erase(std::ranges::unique(piece).begin(), piece.end());
  std::erase(piece, end);
  return piece;
}

std::vector<std::size_t> points(const Series& series) {
  std::vector<std::size_t> taken;
  const std::size_t count = series.x.size();
  const std::size_t pieces = count <= kLongest ? count : kPieces;
  for (std::size_t k = 0; k < pieces; ++k) {
    std::ranges::copy(piece_points(series, k * count / pieces, (k + 1) * count / pieces),
                      std::back_inserter(taken));
  }
  return taken;
}

json to_json(const Series& series) {
  const std::vector<std::size_t> which = points(series);
  json object{{"label", series.label},         {"color", to_json(series.color)},
              {"width", series.width_px},      {"dashed", series.dashed},
              {"x", numbers(series.x, which)}, {"y", numbers(series.y, which)}};
  if (!series.values.empty()) {
    object["values"] = numbers(series.values, which);
  }
  return object;
}

json to_json(const Axes& axes) {
  json series = json::array();
  for (const Series& one : axes.series) {
    series.push_back(to_json(one));
  }
  return {{"title", axes.title},        {"x_label", axes.x_label},
          {"y_label", axes.y_label},    {"value_label", axes.value_label},
          {"equal", axes.equal_aspect}, {"from_zero", axes.y_from_zero},
          {"series", std::move(series)}};
}

}  // namespace

json to_json(const Figure& figure) {
  json axes = json::array();
  for (const Axes& one : figure.axes) {
    axes.push_back(to_json(one));
  }
  return {{"columns", figure.columns}, {"axes", std::move(axes)}};
}

json color_map_json() {
  json colors = json::array();
  for (std::size_t i = 0; i < kColorSteps; ++i) {
    colors.push_back(
        to_json(color_map(static_cast<double>(i) / static_cast<double>(kColorSteps - 1))));
  }
  return colors;
}

}  // namespace geoflow::tools
