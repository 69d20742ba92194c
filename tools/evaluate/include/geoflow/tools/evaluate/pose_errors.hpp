#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/association.hpp"

/// Errors of aligned pairs. Definitions as in evo (evo/core/metrics.py) and J. Sturm et al., "A
/// benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, eq. (1)-(4). All functions pure.
namespace geoflow::tools {

/// One error for each pair (absolute) or pair of pairs (relative).
struct PoseErrors {
  std::vector<double> translation_m;
  std::vector<double> rotation_rad;  ///< in [0, pi]
};

/// Distance of the positions, and the angle between the rotations.
[[nodiscard]] PoseErrors absolute_errors(const PosePairs& pairs);

enum class DeltaUnit : std::uint8_t {
  kFrames,
  kMetres,  ///< along the estimate's path
  kSeconds,
  kDegrees,  ///< turned by the estimate
};

/// "frames", "m", "s" or "deg".
[[nodiscard]] const char* to_string(DeltaUnit unit) noexcept;

/// Over which stretches relative errors are taken.
struct RelativeOptions {
  double delta = 1.0;  ///< > 0, in `unit`; a whole number for frames
  DeltaUnit unit = DeltaUnit::kSeconds;
  /// A stretch from every pose; otherwise each begins where the last one ended.
  bool all_pairs = false;
  /// How much longer or shorter a stretch may be, as a fraction of delta, where the one nearest to
  /// delta is chosen: with all_pairs in metres and degrees, and in seconds.
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double tolerance = 0.1;
};

/// Indices (first, last) of every stretch.
using IndexPairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// More stretches than this are refused.
inline constexpr std::size_t kMaxStretches = 10'000'000;

/// The stretches of `pairs`; consecutive metres and degrees end at the first pose at which delta is
/// reached. Empty where the path is too short. Errors: an option out of range; more than
/// kMaxStretches.
[[nodiscard]] Result<IndexPairs> stretches(const PosePairs& pairs, const RelativeOptions& options);

/// The error of the estimated motion over each stretch (i, j): E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j),
/// with Q the reference and P the estimate; the length of its translation and its angle.
[[nodiscard]] PoseErrors relative_errors(const PosePairs& pairs, const IndexPairs& stretches);

/// How the correct rate counts.
struct CoverageOptions {
  /// A pose vouches for the time until the next one, but no longer than this.
  Duration max_gap = std::chrono::seconds{1};
  /// Poses with a larger position error do not count; none: every pose does.
  std::optional<double> max_error_m{};
};

/// The fraction, 0 to 1, of [begin, end] for which correct poses vouch: X. Shi et al., "Are we
/// ready for service robots? The OpenLORIS-Scene datasets for lifelong SLAM", ICRA 2020, the
/// correct rate of tracking. 1 for an instant.
[[nodiscard]] double correct_rate(const PosePairs& pairs, HostTime begin, HostTime end,
                                  const CoverageOptions& options);

/// Lengths of the polylines through the estimates and through the references [m].
struct PathLengths {
  double estimate_m = 0;
  double reference_m = 0;
};
[[nodiscard]] PathLengths path_lengths(const PosePairs& pairs);

}  // namespace geoflow::tools
