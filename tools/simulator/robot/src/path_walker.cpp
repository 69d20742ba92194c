#include "src/path_walker.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"

namespace geoflow::simulator {
namespace {

constexpr double kSamePointM = 1e-3;
/// The heading follows the point of the line that is this far ahead.
constexpr double kLookAheadM = 0.3;
/// Of the walker; a trotting Go2 reaches its speed within a second or so.
constexpr double kAccelMps2 = 0.8;
constexpr double kYawAccelRadps2 = 2.0;
constexpr double kYawGainPerS = 2.5;
/// The change of velocity at a corner is made within the smoothing's width; it may ask for this
/// much.
constexpr double kCornerAccelMps2 = 1.5;
constexpr double kCornerTimeS = 0.3;
/// Sharper corners are turned on the spot.
constexpr double kTurnInPlaceRad = 50 * std::numbers::pi / 180;
/// With the heading this far off the line's direction the walker stands and turns.
constexpr double kWalkHeadingRad = 40 * std::numbers::pi / 180;
constexpr double kCreepMps = 0.05;
/// Below these the walker counts as standing.
constexpr double kStillMps = 1e-3;
constexpr double kStillRadps = 1e-3;
/// The speed's own variation has this correlation time.
constexpr double kVariationTimeS = 1.5;
/// A pause lasts between these parts of its mean.
constexpr double kShortestPause = 0.5;
constexpr double kLongestPause = 1.5;

double wrapped(double angle) {
  return std::remainder(angle, 2 * std::numbers::pi);
}

double towards(double value, double target, double step) {
  return value + std::clamp(target - value, -step, step);
}

double corner_speed(double turn_rad) {
  if (turn_rad > kTurnInPlaceRad) {
    return 0;
  }
  const double change = std::max(2 * std::sin(0.5 * turn_rad), kSamePointM);
  return kCornerAccelMps2 * kCornerTimeS / change;
}

class Walker {
 public:
  Walker(const Round& round, const WalkerLimits& limits, RandomStream random, double spacing_s)
      : round_{round},
        limits_{limits},
        random_{random},
        spacing_s_{spacing_s},
        yaw_rad_{round.direction_after(0)},
        until_pause_s_{next_pause()} {}

  void step() {
    vary_speed();
    const bool paused = pause();
    const double turn = wrapped(wanted_heading() - yaw_rad_);
    turn_by(paused ? 0 : turn);
    speed_mps_ = towards(speed_mps_, paused ? 0 : allowed_speed(turn), kAccelMps2 * spacing_s_);
    advance();
  }

  void record(WalkedPath& path) const {
    const Vector2d place = round_.at(distance_m_);
    path.x_m.push_back(place.x());
    path.y_m.push_back(place.y());
    path.yaw_rad.push_back(yaw_rad_);
    path.moving.push_back(speed_mps_ > kStillMps || std::abs(yaw_rate_radps_) > kStillRadps);
  }

 private:
  double next_pause() { return -limits_.pause_interval_s * std::log(1 - random_.uniform()); }

  /// True while pausing.
  bool pause() {
    if (limits_.pause_interval_s <= 0 || limits_.pause_s <= 0) {
      return false;
    }
    until_pause_s_ -= spacing_s_;
    if (until_pause_s_ < -pause_length_s_) {
      until_pause_s_ = next_pause();
      pause_length_s_ = limits_.pause_s * random_.uniform(kShortestPause, kLongestPause);
    }
    return until_pause_s_ < 0;
  }

  void vary_speed() {
    const double keep = std::exp(-spacing_s_ / kVariationTimeS);
    variation_ = keep * variation_ + std::sqrt(1 - keep * keep) * random_.normal();
  }

  [[nodiscard]] double wanted_heading() const {
    double ahead = kLookAheadM;
    for (const Round::Corner& corner : round_.corners_ahead(distance_m_, kLookAheadM)) {
      if (corner.turn_rad > kTurnInPlaceRad) {
        ahead = corner.ahead_m;
        break;
      }
    }
    const Vector2d chord = round_.at(distance_m_ + ahead) - round_.at(distance_m_);
    return chord.norm() < kLookAheadM / 2 ? round_.direction_after(distance_m_)
                                          : std::atan2(chord.y(), chord.x());
  }

  void turn_by(double angle) {
    const double stoppable = std::sqrt(kYawAccelRadps2 * std::abs(angle));
    const double wanted =
        std::min({kYawGainPerS * std::abs(angle), stoppable, limits_.yaw_rate_radps});
    yaw_rate_radps_ =
        towards(yaw_rate_radps_, std::copysign(wanted, angle), kYawAccelRadps2 * spacing_s_);
    yaw_rad_ += yaw_rate_radps_ * spacing_s_;
  }

  [[nodiscard]] double allowed_speed(double turn) const {
    const double aligned = 1 - std::abs(turn) / kWalkHeadingRad;
    double speed = limits_.speed_mps * std::max(0.0, aligned) *
                   std::max(0.0, 1 + limits_.speed_variation * variation_);
    const double braking_m = limits_.speed_mps * limits_.speed_mps / kAccelMps2 + kLookAheadM;
    for (const Round::Corner& corner : round_.corners_ahead(distance_m_, braking_m)) {
      const double there = corner_speed(corner.turn_rad);
      const double braked = std::sqrt(there * there + kAccelMps2 * corner.ahead_m);
      speed = std::min(speed, std::max({braked, there, kCreepMps}));
    }
    return speed;
  }

  /// A corner that is turned on the spot is never run over.
  void advance() {
    double way = speed_mps_ * spacing_s_;
    for (const Round::Corner& corner : round_.corners_ahead(distance_m_, way)) {
      if (corner.turn_rad > kTurnInPlaceRad) {
        way = corner.ahead_m;
        speed_mps_ = 0;
        break;
      }
    }
    distance_m_ += way;
  }

  const Round& round_;
  const WalkerLimits& limits_;
  RandomStream random_;
  double spacing_s_;
  double distance_m_ = 0;
  double speed_mps_ = 0;
  double yaw_rad_;
  double yaw_rate_radps_ = 0;
  double variation_ = 0;
  double until_pause_s_;
  double pause_length_s_ = 0;
};

}  // namespace

Round::Round(std::span<const Vector2d> waypoints) {
  for (const Vector2d& waypoint : waypoints) {
    if (points_.empty() || (waypoint - points_.back()).norm() > kSamePointM) {
      points_.push_back(waypoint);
    }
  }
  const bool closed =
      points_.size() > 3 && (points_.front() - points_.back()).norm() <= kSamePointM;
  if (closed) {
    points_.pop_back();
  } else {
    for (std::size_t i = points_.size(); i-- > 2;) {
      points_.push_back(points_[i - 1]);
    }
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    starts_m_.push_back(length_m_);
    length_m_ += (point(i + 1) - points_[i]).norm();
  }
}

std::size_t Round::segment_of(double distance_m) const {
  const auto next = std::ranges::partition_point(
      starts_m_, [&](double start_m) { return start_m <= distance_m; });
  return static_cast<std::size_t>(next - starts_m_.begin()) - 1;
}

Vector2d Round::at(double distance_m) const {
  const double in_round = std::fmod(distance_m, length_m_);
  const std::size_t segment = segment_of(in_round);
  const Vector2d along = point(segment + 1) - points_[segment];
  return points_[segment] + (in_round - starts_m_[segment]) * along.normalized();
}

double Round::direction_after(double distance_m) const {
  const std::size_t segment = segment_of(std::fmod(distance_m + kSamePointM / 2, length_m_));
  const Vector2d along = point(segment + 1) - points_[segment];
  return std::atan2(along.y(), along.x());
}

double Round::turn_at(std::size_t index) const {
  const Vector2d before = point(index) - point(index + points_.size() - 1);
  const Vector2d after = point(index + 1) - point(index);
  return std::acos(std::clamp(before.normalized().dot(after.normalized()), -1.0, 1.0));
}

std::vector<Round::Corner> Round::corners_ahead(double distance_m, double range_m) const {
  std::vector<Corner> corners;
  const double in_round = std::fmod(distance_m + kSamePointM / 2, length_m_);
  std::size_t index = segment_of(in_round) + 1;
  double ahead =
      (index < starts_m_.size() ? starts_m_[index] : length_m_) - in_round + kSamePointM / 2;
  while (ahead <= range_m) {
    corners.push_back({.ahead_m = ahead, .turn_rad = turn_at(index % points_.size())});
    ahead += (point(index + 1) - point(index)).norm();
    ++index;
  }
  return corners;
}

WalkedPath walk_round(const Round& round, const WalkerLimits& limits, RandomStream random,
                      double spacing_s, std::size_t count) {
  Walker walker{round, limits, random, spacing_s};
  WalkedPath path;
  for (std::size_t i = 0; i < count; ++i) {
    if (static_cast<double>(i) * spacing_s > limits.stand_s) {
      walker.step();
    }
    walker.record(path);
  }
  return path;
}

}  // namespace geoflow::simulator
