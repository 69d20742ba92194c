#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"

namespace geoflow::tools {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;
/// More frames than any trajectory file holds.
constexpr double kMaxFrames = 1e9;
constexpr double kHalfTurnDeg = 180.0;

double step_m(const PosePairs& pairs, std::size_t k) {
  return (pairs[k].estimate.translation() - pairs[k - 1].estimate.translation()).norm();
}

double angle_rad(const PosePairs& pairs, std::size_t i, std::size_t j) {
  return pairs[i].estimate.rotation().angularDistance(pairs[j].estimate.rotation());
}

IndexPairs by_frames(std::size_t count, std::size_t delta, bool all_pairs) {
  IndexPairs result;
  for (std::size_t i = 0; delta < count && i < count - delta; i += all_pairs ? 1 : delta) {
    result.emplace_back(i, i + delta);
  }
  return result;
}

/// How far each pose is along the trajectory: metres of path or seconds since the first pose. Never
/// decreases.
std::vector<double> progress(const PosePairs& pairs, DeltaUnit unit) {
  std::vector<double> along(pairs.size(), 0.0);
  for (std::size_t k = 1; k < pairs.size(); ++k) {
    along[k] = unit == DeltaUnit::kMetres ? along[k - 1] + step_m(pairs, k)
                                          : to_seconds(pairs[k].t - pairs.front().t);
  }
  return along;
}

/// The pose after `i` whose progress is nearest to `delta` more; the first of equally near ones. i
/// is not the last.
std::size_t nearest_end(const std::vector<double>& along, std::size_t i, double delta) {
  const double target = along[i] + delta;
  const auto begin = std::next(along.begin(), static_cast<std::ptrdiff_t>(i) + 1);
  auto found = std::lower_bound(begin, along.end(), target);
  if (found == along.end() || (found != begin && target - *std::prev(found) <= *found - target)) {
    found = std::lower_bound(begin, along.end(), *std::prev(found));
  }
  return static_cast<std::size_t>(std::distance(along.begin(), found));
}

/// From every pose, or from the end of each stretch, to the pose nearest to delta further on; those
/// within tolerance.
IndexPairs by_nearest_progress(const std::vector<double>& along, const RelativeOptions& options) {
  IndexPairs result;
  std::size_t i = 0;
  while (i + 1 < along.size()) {
    const std::size_t j = nearest_end(along, i, options.delta);
    if (std::abs(along[j] - along[i] - options.delta) <= options.tolerance * options.delta) {
      result.emplace_back(i, j);
    }
    i = options.all_pairs ? i + 1 : j;
  }
  return result;
}

/// evo's rule: path is summed from the first pose, an index noted and the sum reset whenever delta
/// is reached; stretches are those between noted indices.
IndexPairs by_consecutive_path(const PosePairs& pairs, double delta_m) {
  std::vector<std::size_t> ends;
  double path_m = 0;
  for (std::size_t k = 1; k < pairs.size(); ++k) {
    path_m += step_m(pairs, k);
    if (path_m >= delta_m) {
      ends.push_back(k);
      path_m = 0;
    }
  }
  IndexPairs result;
  for (std::size_t n = 1; n < ends.size(); ++n) {
    result.emplace_back(ends[n - 1], ends[n]);
  }
  return result;
}

IndexPairs by_consecutive_angle(const PosePairs& pairs, double delta_rad) {
  IndexPairs result;
  double turned_rad = 0;
  std::size_t start = 0;
  for (std::size_t k = 1; k < pairs.size(); ++k) {
    turned_rad += angle_rad(pairs, k - 1, k);
    if (turned_rad >= delta_rad) {
      result.emplace_back(start, k);
      turned_rad = 0;
      start = k;
    }
  }
  return result;
}

/// Every two poses that are turned by delta to each other, within tolerance.
Result<IndexPairs> by_every_angle(const PosePairs& pairs, double delta_rad, double tolerance_rad) {
  IndexPairs result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      if (std::abs(angle_rad(pairs, i, j) - delta_rad) <= tolerance_rad) {
        result.emplace_back(i, j);
      }
    }
    if (result.size() > kMaxStretches) {
      return fail(ErrorCode::kInvalidArgument,
                  "more than {} pairs of poses are turned so: use consecutive pairs",
                  kMaxStretches);
    }
  }
  return result;
}

Result<void> check(const RelativeOptions& options) {
  if (!(options.delta > 0) || !std::isfinite(options.delta)) {
    return fail(ErrorCode::kInvalidArgument,
                "the delta of relative errors must be a positive number");
  }
  if (options.unit == DeltaUnit::kFrames &&
      (options.delta != std::floor(options.delta) || options.delta > kMaxFrames)) {
    return fail(ErrorCode::kInvalidArgument, "a delta in frames must be a whole number below 1e9");
  }
  if (options.unit == DeltaUnit::kDegrees && options.delta > kHalfTurnDeg) {
    return fail(ErrorCode::kInvalidArgument, "a delta in degrees must be at most 180");
  }
  if (!(options.tolerance >= 0) || !std::isfinite(options.tolerance)) {
    return fail(ErrorCode::kInvalidArgument, "the tolerance of delta must not be negative");
  }
  return {};
}

}  // namespace

const char* to_string(DeltaUnit unit) noexcept {
  switch (unit) {
    case DeltaUnit::kFrames:
      return "frames";
    case DeltaUnit::kMetres:
      return "m";
    case DeltaUnit::kSeconds:
      return "s";
    case DeltaUnit::kDegrees:
      return "deg";
  }
  return "unknown";
}

Result<IndexPairs> stretches(const PosePairs& pairs, const RelativeOptions& options) {
  return check(options).and_then([&]() -> Result<IndexPairs> {
    switch (options.unit) {
      case DeltaUnit::kFrames:
        return by_frames(pairs.size(), static_cast<std::size_t>(options.delta), options.all_pairs);
      case DeltaUnit::kMetres:
        return options.all_pairs ? by_nearest_progress(progress(pairs, options.unit), options)
                                 : by_consecutive_path(pairs, options.delta);
      case DeltaUnit::kSeconds:
        return by_nearest_progress(progress(pairs, options.unit), options);
      case DeltaUnit::kDegrees: {
        const double delta_rad = options.delta * kRadiansPerDegree;
        return options.all_pairs ? by_every_angle(pairs, delta_rad, options.tolerance * delta_rad)
                                 : by_consecutive_angle(pairs, delta_rad);
      }
    }
    return fail(ErrorCode::kInvalidArgument, "unknown unit of delta");
  });
}

}  // namespace geoflow::tools
