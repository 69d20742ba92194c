#pragma once

#include <string>
#include <vector>

namespace geoflow::tools {

/// An interval of data values, low < high, both finite.
struct Range {
  double low = 0;
  double high = 1;

  [[nodiscard]] double span() const noexcept { return high - low; }
};

/// Grows from nothing over values; those that are not finite, or beyond what can be drawn, do not
/// count.
class RangeFinder {
 public:
  void add(double value) noexcept;
  /// What was seen, widened where it is a single value; 0 to 1 where nothing was.
  [[nodiscard]] Range range() const noexcept;

 private:
  bool seen_ = false;
  double low_ = 0;
  double high_ = 0;
};

/// True for values that can be drawn: finite and not so large that differences overflow.
[[nodiscard]] bool drawable(double value) noexcept;

/// The range with `fraction` of its span more on either side.
[[nodiscard]] Range padded(const Range& range, double fraction) noexcept;

struct Tick {
  double value = 0;
  std::string label;
};

/// Round values (1, 2 or 5 times a power of ten apart) within the range, about `count` of them and
/// at most 3 * count.
[[nodiscard]] std::vector<Tick> ticks(const Range& range, int count);

/// Of a range of decimal logarithms: 1, 2 and 5 times powers of ten where it is narrow, else powers
/// of ten alone.
[[nodiscard]] std::vector<Tick> decade_ticks(const Range& range);

}  // namespace geoflow::tools
