#include "plot/src/colors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {
namespace {

// NOLINTBEGIN(modernize-use-std-numbers): a share of blue that is near one of them by chance
constexpr std::array<Color, 7> kAnchors{{{.red = 0.050, .green = 0.030, .blue = 0.528},
                                         {.red = 0.306, .green = 0.010, .blue = 0.640},
                                         {.red = 0.513, .green = 0.038, .blue = 0.650},
                                         {.red = 0.692, .green = 0.165, .blue = 0.564},
                                         {.red = 0.831, .green = 0.321, .blue = 0.438},
                                         {.red = 0.933, .green = 0.486, .blue = 0.316},
                                         {.red = 0.988, .green = 0.710, .blue = 0.170}}};
// NOLINTEND(modernize-use-std-numbers)
constexpr Color kUnknown{.red = 0.5, .green = 0.5, .blue = 0.5};

}  // namespace

Color color_map(double fraction) noexcept {
  if (std::isnan(fraction)) {
    return kUnknown;
  }
  const double place = std::clamp(fraction, 0.0, 1.0) * (kAnchors.size() - 1);
  const auto index = std::min(static_cast<std::size_t>(place), kAnchors.size() - 2);
  const double t = place - static_cast<double>(index);
  const Color& a = kAnchors.at(index);
  const Color& b = kAnchors.at(index + 1);
  return {.red = std::lerp(a.red, b.red, t),
          .green = std::lerp(a.green, b.green, t),
          .blue = std::lerp(a.blue, b.blue, t)};
}

}  // namespace geoflow::tools
