#include "plot/src/scale.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/core.h>

namespace geoflow::tools {
namespace {

constexpr double kBase = 10.0;
constexpr double kHalfBase = 5.0;
/// Beyond this, coordinates are some mistake and only spoil the picture.
constexpr double kLargest = 1e12;
/// Labels of larger numbers are written with an exponent.
constexpr double kLargestPlain = 1e6;
constexpr int kMaxDecimals = 9;
/// A range of a single value is made this wide, relative to the value.
constexpr double kNarrowest = 1e-9;

/// The round step nearest above span / count.
double round_step(double span, int count) {
  const double rough = span / count;
  const double power = std::pow(kBase, std::floor(std::log10(rough)));
  for (const double multiple : {1.0, 2.0, kHalfBase}) {
    if (multiple * power >= rough * (1.0 - kNarrowest)) {
      return multiple * power;
    }
  }
  return kBase * power;
}

std::string label(double value, double step) {
  if (std::abs(value) < step * kNarrowest) {
    value = 0;
  }
  const int decimals = static_cast<int>(std::ceil(-std::log10(step) - kNarrowest));
  if (std::abs(value) >= kLargestPlain || decimals > kMaxDecimals) {
    return fmt::format("{:g}", value);
  }
  return fmt::format("{:.{}f}", value, std::max(0, decimals));
}

}  // namespace

bool drawable(double value) noexcept {
  return std::abs(value) <= kLargest;
}

void RangeFinder::add(double value) noexcept {
  if (!drawable(value)) {
    return;
  }
  low_ = seen_ ? std::min(low_, value) : value;
  high_ = seen_ ? std::max(high_, value) : value;
  seen_ = true;
}

Range RangeFinder::range() const noexcept {
  if (!seen_) {
    return {};
  }
  const double narrowest = kNarrowest * std::max({std::abs(low_), std::abs(high_), kNarrowest});
  if (high_ - low_ > narrowest) {
    return {.low = low_, .high = high_};
  }
  const double half = low_ == 0.0 ? 0.5 : 0.5 * std::abs(low_);
  return {.low = low_ - half, .high = high_ + half};
}

Range padded(const Range& range, double fraction) noexcept {
  const double more = fraction * range.span();
  return {.low = range.low - more, .high = range.high + more};
}

std::vector<Tick> ticks(const Range& range, int count) {
  const double step = round_step(range.span(), count);
  const double first = std::ceil(range.low / step - kNarrowest);
  std::vector<Tick> result;
  for (int i = 0; i < 3 * count; ++i) {
    const double value = (first + i) * step;
    if (value > range.high + step * kNarrowest) {
      break;
    }
    result.push_back({.value = value, .label = label(value, step)});
  }
  return result;
}

std::vector<Tick> decade_ticks(const Range& range) {
  constexpr double kWide = 3;  // decades
  const int step = std::max(1, static_cast<int>(std::ceil(range.span() / kBase)));
  std::vector<Tick> result;
  const int last = static_cast<int>(std::floor(range.high));
  for (int power = static_cast<int>(std::floor(range.low)); power <= last; power += step) {
    for (const double multiple : {1.0, 2.0, kHalfBase}) {
      const double value = power + std::log10(multiple);
      const bool wanted = multiple == 1.0 || range.span() < kWide;
      if (wanted && value >= range.low && value <= range.high) {
        result.push_back({.value = value, .label = fmt::format("{:g}e{}", multiple, power)});
      }
    }
  }
  return result;
}

}  // namespace geoflow::tools
