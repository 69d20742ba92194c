#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"

/// Walks a point with a heading along a polyline, in steps of control time: what SmoothSignal then
/// makes smooth.
namespace geoflow::simulator {

/// A polyline that is walked round and round. An open one is walked back and forth: its way back is
/// part of the round, and its ends are corners of 180 degrees.
class Round {
 public:
  /// At least two different waypoints [m].
  explicit Round(std::span<const Vector2d> waypoints);

  /// False where all waypoints are one.
  [[nodiscard]] bool is_line() const noexcept { return points_.size() > 1; }
  [[nodiscard]] double length_m() const noexcept { return length_m_; }

  /// The point at a distance from the start, any distance >= 0.
  [[nodiscard]] Vector2d at(double distance_m) const;

  /// How far it is from `distance_m` on to a corner, and what direction changes there.
  struct Corner {
    double ahead_m = 0;
    double turn_rad = 0;  ///< 0 to pi
  };
  /// The corners in (distance, distance + range], nearest first.
  [[nodiscard]] std::vector<Corner> corners_ahead(double distance_m, double range_m) const;

  /// Direction of the polyline just after `distance_m` [rad].
  [[nodiscard]] double direction_after(double distance_m) const;

 private:
  [[nodiscard]] const Vector2d& point(std::size_t index) const {
    return points_[index % points_.size()];
  }
  [[nodiscard]] double turn_at(std::size_t index) const;
  /// The segment that holds `distance_m` of the round, its start included.
  [[nodiscard]] std::size_t segment_of(double distance_m) const;

  std::vector<Vector2d> points_;
  std::vector<double> starts_m_;  ///< distance of each point from the first
  double length_m_ = 0;
};

struct WalkerLimits {
  double speed_mps = 0;
  double speed_variation = 0;  ///< standard deviation, relative
  double yaw_rate_radps = 0;
  double stand_s = 0;           ///< before the first step
  double pause_interval_s = 0;  ///< walking time between pauses on average; 0 never
  double pause_s = 0;
};

/// Where a walker is at the instants k * spacing.
struct WalkedPath {
  std::vector<double> x_m, y_m, yaw_rad;
  std::vector<bool> moving;
};

/// Walks for `count` instants: along the line and never off it, slower in bends, standing still to
/// turn at sharp corners, the heading following a point ahead.
[[nodiscard]] WalkedPath walk_round(const Round& round, const WalkerLimits& limits,
                                    RandomStream random, double spacing_s, std::size_t count);

}  // namespace geoflow::simulator
