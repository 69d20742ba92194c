#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/preintegration.hpp"

/// What a sample is worth, judged from itself and its neighbours.
namespace geoflow::slam {

/// What the sensor can measure, per axis. Defaults: what a D435i's BMI055 or BMI085 is configured
/// to, +-4 g and +-1000 deg/s.
struct ImuRange {
  // NOLINTBEGIN(readability-magic-numbers): each default is given its unit by its member
  double accel_mps2 = 39.2266;
  double gyro_radps = 17.4533;
  // NOLINTEND(readability-magic-numbers)
};

/// Counts of samples, each counted once although packets overlap.
struct ScreenCounters {
  std::uint64_t samples = 0;       ///< taken, good or bad
  std::uint64_t not_finite = 0;    ///< left out
  std::uint64_t out_of_order = 0;  ///< left out: not newer than the one before in its packet
  std::uint64_t stuck = 0;         ///< left out: nothing has moved for 50 ms
  std::uint64_t saturated = 0;     ///< kept, with the noise of what lies beyond the range
  std::uint64_t repaired = 0;      ///< replaced: no body moves like this
  std::uint64_t shocks = 0;        ///< kept, with their own size as noise
  std::uint64_t gaps = 0;          ///< longer than 1.5 periods before a sample
};

/// Judges an IMU's samples. A legged robot's touchdown reaches 40 m/s^2 and more (paper, figure 9):
/// what looks like a spike of the accelerometer is most often true, so it is kept and trusted less.
///
/// - An outlier is a sample that stands off the line between its neighbours by more than six
///   standard deviations, estimated as 1.4826 times the median of such distances in the last 0.2 s
///   (Hampel 1974; at least the sensor's noise), while the neighbours and the one before them
///   agree with each other: a single sample left a level and returned to it.
///   Accelerometer: variance of its distance squared is added. Gyroscope: likewise, but if it
///   takes more than 1000 rad/s^2 there and back it is replaced by the line (a real Go1 that trots
///   stays below 220).
/// - What is beyond the range by more than 2 % was never measured: replaced.
/// - At the end of the range the true value is unknown: a quarter of the range is added as noise.
/// - Values that repeat bit for bit for 50 ms, and what is not finite, are left out: preintegrate()
///   bridges or refuses the gap.
///
/// Thread-compatible.
class ImuScreen {
 public:
  explicit ImuScreen(const ImuNoise& noise, const ImuRange& range = {});

  /// The samples of one packet, judged. The last has no neighbour after it and is judged again in
  /// the next packet, which has it too.
  [[nodiscard]] std::vector<InertialSample> screen(std::span<const Timed<ImuSample>> samples);

  [[nodiscard]] const ScreenCounters& counters() const noexcept { return counters_; }

 private:
  struct Raw {
    HostTime t;
    Vector6d values;  ///< (gyro, accel)
  };
  enum class Kind : std::uint8_t { kPlain, kShock, kSaturated, kRepaired };
  static constexpr std::size_t kKinds = 4;
  struct Axis {
    double value = 0;
    double added_variance = 0;
    Kind kind = Kind::kPlain;
  };

  void take(std::span<const Timed<ImuSample>> samples, HostTime newest);
  [[nodiscard]] Vector6d off_line(std::size_t i) const;
  [[nodiscard]] Vector6d typical_distance() const;
  [[nodiscard]] bool is_stuck(std::size_t i) const;
  [[nodiscard]] Axis judge_axis(std::size_t i, int axis, double typical) const;
  [[nodiscard]] InertialSample judge(std::size_t i, const Vector6d& typical);

  ImuNoise noise_;
  ImuRange range_;
  ScreenCounters counters_;
  std::deque<Raw> line_;                ///< the last 0.2 s and the packet
  HostTime newest_ = HostTime::min();   ///< taken
  HostTime settled_ = HostTime::min();  ///< judged with both neighbours
};

}  // namespace geoflow::slam
