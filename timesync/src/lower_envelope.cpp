#include "lower_envelope.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

namespace geoflow::timesync {
namespace {

/// > 0 where the path a, b, c turns left (b lies below the chord from a to c).
double turn(const EnvelopePoint& a, const EnvelopePoint& b, const EnvelopePoint& c) {
  return (b.x_ns - a.x_ns) * (c.y_ns - a.y_ns) - (b.y_ns - a.y_ns) * (c.x_ns - a.x_ns);
}

/// Slope of the lower hull's edge over `x_ns` (Andrew's monotone chain).
double hull_slope_at(std::span<const EnvelopePoint> points, double x_ns) {
  std::array<EnvelopePoint, kMaxEnvelopePoints> hull;
  std::size_t size = 0;
  for (const EnvelopePoint& point : points) {
    while (size >= 2 && turn(hull[size - 2], hull[size - 1], point) <= 0.0) {
      --size;
    }
    hull[size++] = point;
  }
  std::size_t right = 1;
  while (right + 1 < size && hull[right].x_ns < x_ns) {
    ++right;
  }
  return (hull[right].y_ns - hull[right - 1].y_ns) / (hull[right].x_ns - hull[right - 1].x_ns);
}

}  // namespace

std::optional<EnvelopeLine> lower_envelope(std::span<const EnvelopePoint> points,
                                           SlopeRange slopes) {
  if (points.size() < 2 || points.size() > kMaxEnvelopePoints) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(points.size());
  double mean_x_ns = 0;
  double mean_y_ns = 0;
  for (const EnvelopePoint& point : points) {
    mean_x_ns += point.x_ns / count;
    mean_y_ns += point.y_ns / count;
  }
  EnvelopeLine line;
  line.slope = std::clamp(hull_slope_at(points, mean_x_ns), slopes.lowest, slopes.highest);
  line.offset_ns = std::numeric_limits<double>::infinity();
  for (const EnvelopePoint& point : points) {
    line.offset_ns = std::min(line.offset_ns, point.y_ns - line.slope * point.x_ns);
  }
  line.scatter_ns = mean_y_ns - line.offset_ns - line.slope * mean_x_ns;
  return line;
}

}  // namespace geoflow::timesync
