#pragma once

#include <cstdint>
#include <optional>
#include <span>

/// The line under all points that is nearest to them: the clock line beneath one-sided delays.
///
/// Of all lines y = a + b x with a + b x_i <= y_i for every i, the one that minimises sum (y_i - a
/// - b x_i) is the edge of the points' lower convex hull that spans the mean of x (S. Moon, P.
/// Skelly, D. Towsley, "Estimation and removal of clock skew from network delay measurements",
/// INFOCOM 1999, section IV; L. Zhang, Z. Liu, C. Xia, "Clock synchronization algorithms for
/// network measurements", INFOCOM 2002: the hull form).
namespace geoflow::timesync {

/// A point relative to some reference: x device, y the delay left by the reference line [ns].
struct EnvelopePoint {
  double x_ns = 0;
  double y_ns = 0;
};

struct EnvelopeLine {
  double offset_ns = 0;   ///< at x = 0
  double slope = 0;       ///< dimensionless
  double scatter_ns = 0;  ///< mean height of the points above the line
};

/// The most points that one call takes.
inline constexpr int kMaxEnvelopePoints = 64;

/// The slopes that are allowed.
struct SlopeRange {
  double lowest = 0;
  double highest = 0;
};

/// The envelope of points with strictly increasing x; none for fewer than two or more than
/// kMaxEnvelopePoints. Where the slope is clamped to its range, the line still touches the points
/// from below. O(n), no allocation.
[[nodiscard]] std::optional<EnvelopeLine> lower_envelope(std::span<const EnvelopePoint> points,
                                                         SlopeRange slopes);

}  // namespace geoflow::timesync
