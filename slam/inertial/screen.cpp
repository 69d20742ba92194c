#include "inertial/screen.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"
#include "inertial/preintegration.hpp"

namespace geoflow::slam {
namespace {

constexpr Duration kMemory = std::chrono::milliseconds{200};
constexpr Duration kStuck = std::chrono::milliseconds{50};
constexpr double kGapPeriods = 1.5;

/// Standard deviation of a normal distribution by the median of its absolute value.
constexpr double kMedianToSigma = 1.4826;
constexpr double kOutlierSigmas = 6.0;
/// Neighbours agree when they differ by less than this share of the outlier's distance; and the two
/// before it likewise.
constexpr double kAgreement = 0.5;
/// Variance of the distance from the line between two neighbours, by that of a sample: 1 + 2 / 4.
constexpr double kOffLine = 1.5;
constexpr double kMostAngularAcceleration = 1000.0;  // [rad/s^2]

constexpr double kBeyondRange = 1.02;
constexpr double kAtRange = 0.99;
constexpr double kClippedShare = 0.25;

Vector6d to_values(const ImuSample& sample) {
  Vector6d values;
  values << sample.gyro_radps, sample.accel_mps2;
  return values;
}

}  // namespace

ImuScreen::ImuScreen(const ImuNoise& noise, const ImuRange& range) : noise_{noise}, range_{range} {}

/// Puts the packet behind what came before it.
void ImuScreen::take(std::span<const Timed<ImuSample>> samples, HostTime newest) {
  const HostTime begin = samples.front().t;
  while (!line_.empty() && line_.back().t >= begin) {
    line_.pop_back();
  }
  while (!line_.empty() && line_.front().t < begin - kMemory) {
    line_.pop_front();
  }
  for (const Timed<ImuSample>& timed : samples) {
    const Raw raw{.t = timed.t, .values = to_values(timed.sample)};
    const std::uint64_t once = timed.t > newest ? 1 : 0;
    counters_.samples += once;
    newest_ = std::max(newest_, timed.t);
    if (!raw.values.allFinite()) {
      counters_.not_finite += once;
    } else if (!line_.empty() && line_.back().t >= timed.t) {
      ++counters_.out_of_order;
    } else {
      const double since_s = line_.empty() ? 0 : to_seconds(timed.t - line_.back().t);
      counters_.gaps += since_s * noise_.rate_hz > kGapPeriods ? once : 0;
      line_.push_back(raw);
    }
  }
}

/// Distance of a sample from the line between its neighbours; zero at the ends.
Vector6d ImuScreen::off_line(std::size_t i) const {
  if (i == 0 || i + 1 >= line_.size()) {
    return Vector6d::Zero();
  }
  const Raw& before = line_[i - 1];
  const Raw& after = line_[i + 1];
  const double ratio = to_seconds(line_[i].t - before.t) / to_seconds(after.t - before.t);
  return line_[i].values - (before.values + ratio * (after.values - before.values));
}

/// Standard deviation of off_line() by its median, at least what the sensor's noise makes.
Vector6d ImuScreen::typical_distance() const {
  const double root = std::sqrt(noise_.rate_hz * kOffLine);
  Vector6d typical;
  typical << Vector3d::Constant(root * noise_.gyro_noise_density),
      Vector3d::Constant(root * noise_.accel_noise_density);
  std::vector<double> distances;
  for (int axis = 0; axis < kBiasSize; ++axis) {
    distances.clear();
    for (std::size_t i = 1; i + 1 < line_.size(); ++i) {
      distances.push_back(std::abs(off_line(i)[axis]));
    }
    if (!distances.empty()) {
      const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
      std::nth_element(distances.begin(), middle, distances.end());
      typical[axis] = std::max(typical[axis], kMedianToSigma * *middle);
    }
  }
  return typical;
}

bool ImuScreen::is_stuck(std::size_t i) const {
  std::size_t first = i;
  while (first > 0 && line_[first - 1].values == line_[i].values) {
    --first;
  }
  return line_[i].t - line_[first].t >= kStuck;
}

ImuScreen::Axis ImuScreen::judge_axis(std::size_t i, int axis, double typical) const {
  const bool gyro = axis < kBiasSize / 2;
  const double range = gyro ? range_.gyro_radps : range_.accel_mps2;
  const double value = line_[i].values[axis];
  const bool inner = i > 0 && i + 1 < line_.size();
  const double distance = off_line(i)[axis];
  const double size = std::abs(distance);
  bool outlier = false;
  double period_s = 0;
  if (inner) {
    const Raw& before = line_[i - 1];
    const Raw& after = line_[i + 1];
    period_s = 0.5 * to_seconds(after.t - before.t);
    // A touchdown rises over several samples; an isolated one leaves a level and returns to it.
    const double rise = i > 1 ? std::abs(before.values[axis] - line_[i - 2].values[axis]) : 0;
    outlier = size > kOutlierSigmas * typical && rise < kAgreement * size &&
              std::abs(after.values[axis] - before.values[axis]) < kAgreement * size;
  }
  const double unknown = kClippedShare * range;
  if (std::abs(value) > kBeyondRange * range ||
      (outlier && gyro && size > kMostAngularAcceleration * period_s)) {
    // Without a neighbour on each side, the end of the range is all that is known.
    return inner ? Axis{.value = value - distance,
                        .added_variance = typical * typical,
                        .kind = Kind::kRepaired}
                 : Axis{.value = std::clamp(value, -range, range),
                        .added_variance = unknown * unknown,
                        .kind = Kind::kRepaired};
  }
  if (std::abs(value) > kAtRange * range) {
    return {.value = value, .added_variance = unknown * unknown, .kind = Kind::kSaturated};
  }
  return {.value = value,
          .added_variance = outlier ? size * size : 0,
          .kind = outlier ? Kind::kShock : Kind::kPlain};
}

InertialSample ImuScreen::judge(std::size_t i, const Vector6d& typical) {
  Vector6d values;
  Vector6d added;
  std::array<bool, kKinds> found{};
  for (int axis = 0; axis < kBiasSize; ++axis) {
    const Axis judged = judge_axis(i, axis, typical[axis]);
    values[axis] = judged.value;
    added[axis] = judged.added_variance;
    found[static_cast<std::size_t>(judged.kind)] = true;
  }
  // Counted once both neighbours are known.
  if (i + 1 < line_.size() && line_[i].t > settled_) {
    settled_ = line_[i].t;
    const auto seen = [&](Kind kind) -> std::uint64_t {
      return found[static_cast<std::size_t>(kind)] ? 1 : 0;
    };
    counters_.repaired += seen(Kind::kRepaired);
    counters_.saturated += seen(Kind::kSaturated);
    counters_.shocks += seen(Kind::kShock);
  }
  return {.t = line_[i].t,
          .sample = {.accel_mps2 = values.tail<3>(), .gyro_radps = values.head<3>()},
          .gyro_variance_radps2 = added.head<3>().maxCoeff(),
          .accel_variance_m2ps4 = added.tail<3>().maxCoeff()};
}

std::vector<InertialSample> ImuScreen::screen(std::span<const Timed<ImuSample>> samples) {
  std::vector<InertialSample> result;
  if (samples.empty()) {
    return result;
  }
  const HostTime newest = newest_;
  take(samples, newest);
  const Vector6d typical = typical_distance();
  result.reserve(samples.size());
  for (std::size_t i = 0; i < line_.size(); ++i) {
    if (line_[i].t < samples.front().t) {
      continue;
    }
    if (is_stuck(i)) {
      counters_.stuck += line_[i].t > newest ? 1U : 0U;
    } else {
      result.push_back(judge(i, typical));
    }
  }
  return result;
}

}  // namespace geoflow::slam
