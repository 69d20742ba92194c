#include "geoflow/timesync/clock_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/block_minima.hpp"

#include "lower_envelope.hpp"

namespace geoflow::timesync {
namespace {

constexpr double kUnseenEnvelope =
    0.25;  // c: the least delay of a window may lie so many medians above the least ever
constexpr double kWander =
    1e-6;  // w: what an oscillator's rate may change by while it is not watched
constexpr double kLateGateMedians = 10.0;
constexpr double kEarlyGateMedians = 4.0;
constexpr std::size_t kMinBlocksForDrift = 2;
constexpr std::int64_t kFarNs = std::int64_t{1}
                                << 60;  // 36 years: beyond it a difference says nothing

static_assert(BlockMinima::kBlocks <= kMaxEnvelopePoints);

double to_ns(Duration duration) {
  return static_cast<double>(duration.count());
}

std::int64_t round_ns(double ns) {
  return std::llround(ns);
}

}  // namespace

Placed ClockFit::add(std::int64_t device_ns, std::int64_t arrival_ns) noexcept {
  ++counters_.samples;
  const StampPair pair{.device_ns = device_ns,
                       .arrival_ns = arrival_ns - config_.min_delay.count()};
  if (since_lock_ == 0) {
    lock(pair);
  } else {
    const double residual = residual_ns(pair);
    if (is_outlier(residual, bound_ns(device_ns))) {
      ++counters_.outliers;
      if (!jumped(pair, residual)) {
        return place_doubtful(pair, residual);
      }
      line_.offset_ns += jump_.lowest_ns();
      ++counters_.jumps;
      lock(pair);
    } else {
      accept(pair, residual);
    }
  }
  Placed placed = place(device_ns);
  placed.t_ns = std::min(placed.t_ns, pair.arrival_ns);  // nothing arrives before it happened
  return placed;
}

Placed ClockFit::place(std::int64_t device_ns) const noexcept {
  const std::int64_t from_origin = device_ns - line_.origin.device_ns;
  if (since_lock_ == 0 || from_origin > kFarNs || from_origin < -kFarNs) {
    return {.t_ns = newest_.arrival_ns,
            .error_bound_ns = std::numeric_limits<std::int64_t>::max(),
            .by_arrival = true};
  }
  const double correction = line_.offset_ns + line_.drift * static_cast<double>(from_origin);
  return {.t_ns = line_.origin.arrival_ns + from_origin + round_ns(correction),
          .error_bound_ns = round_ns(bound_ns(device_ns)),
          .by_arrival = false};
}

std::int64_t ClockFit::expect_device_ns(std::int64_t arrival_ns) const noexcept {
  const std::int64_t elapsed = arrival_ns - config_.min_delay.count() - newest_.arrival_ns;
  const bool usable = since_lock_ > 0 && elapsed > -kFarNs && elapsed < kFarNs;
  return usable ? newest_.device_ns + elapsed : newest_.device_ns;
}

/// Begins a stretch of trust at `pair`. The line's rate is kept, and after a jump its new place as
/// well.
void ClockFit::lock(const StampPair& pair) noexcept {
  const bool first = counters_.jumps == 0;
  const double height = first ? 0.0 : residual_ns(pair);
  line_.origin = pair;
  line_.offset_ns = -height;
  line_.scatter_ns = 0;
  line_.drift_error = first ? config_.max_drift : line_.drift_error;
  minima_.reset();
  spread_.reset();
  jump_.clear();
  since_lock_ = 0;
  newest_ = pair;
  accept(pair, height);
}

void ClockFit::accept(const StampPair& pair, double residual_ns) noexcept {
  ++since_lock_;
  jump_.clear();
  if (pair.device_ns > newest_.device_ns) {
    newest_ = pair;
  }
  const bool closed = minima_.add(pair, residual_ns, config_.block.count());
  if (residual_ns < 0.0) {
    line_.offset_ns += residual_ns;
    minima_.lower_line_by(-residual_ns);
  }
  spread_.add(std::max(residual_ns, 0.0));
  if (closed) {
    refit();
  }
}

void ClockFit::refit() noexcept {
  if (minima_.size() < kMinBlocksForDrift) {
    return;
  }
  std::array<EnvelopePoint, BlockMinima::kBlocks> points;
  const StampPair origin = minima_[minima_.size() - 1];
  for (std::size_t i = 0; i < minima_.size(); ++i) {
    const StampPair& pair = minima_[i];
    const std::int64_t x = pair.device_ns - origin.device_ns;
    points[i] = {.x_ns = static_cast<double>(x),
                 .y_ns = static_cast<double>(pair.arrival_ns - origin.arrival_ns - x)};
  }
  const std::span<const EnvelopePoint> used{points.data(), minima_.size()};
  const double span = -used.front().x_ns;
  const SlopeRange any_rate{.lowest = -config_.max_drift, .highest = config_.max_drift};
  const SlopeRange known_rate{.lowest = line_.drift, .highest = line_.drift};
  std::optional<EnvelopeLine> fitted = lower_envelope(used, any_rate);
  double drift_error = drift_error_of(fitted ? fitted->scatter_ns : 0.0, span);
  if (minima_.size() < BlockMinima::kBlocks && drift_error > line_.drift_error) {
    fitted = lower_envelope(used, known_rate);  // what was known so far is the better one
    drift_error = line_.drift_error;
  }
  if (!fitted) {
    return;
  }
  line_ = {.origin = origin,
           .offset_ns = fitted->offset_ns,
           .drift = fitted->slope,
           .scatter_ns = fitted->scatter_ns,
           .drift_error = drift_error};
}

double ClockFit::drift_error_of(double scatter_ns, double span_ns) const noexcept {
  const double height_error =
      scatter_ns + kUnseenEnvelope * spread_.median_ns() + to_ns(config_.resolution);
  return std::min(config_.max_drift, height_error / span_ns + kWander);
}

bool ClockFit::jumped(const StampPair& pair, double residual_ns) noexcept {
  const bool may_be_late = residual_ns > 0.0 && residual_ns <= to_ns(config_.max_delay);
  const Duration span = may_be_late ? config_.late_jump_span : config_.jump_span;
  const double gate = std::max(to_ns(config_.min_gate), kLateGateMedians * spread_.median_ns());
  return jump_.add(pair.device_ns, residual_ns, gate, config_.jump_samples, span.count());
}

/// An outlier's place. Late: where the line says; later than is believable, or early: a usual delay
/// before its arrival. A late sample's bound is all of its lateness, so that it covers both: a slow
/// transport, and a clock that jumped.
Placed ClockFit::place_doubtful(const StampPair& pair, double residual_ns) const noexcept {
  const double lateness = std::clamp(residual_ns, 0.0, static_cast<double>(kFarNs));
  Placed placed;
  if (residual_ns > 0.0 && residual_ns <= to_ns(config_.max_delay)) {
    placed = place(pair.device_ns);
  } else {
    const std::int64_t usual_delay = round_ns(spread_.median_ns());
    placed = {.t_ns = pair.arrival_ns - usual_delay,
              .error_bound_ns = std::max(config_.first_bound.count(), usual_delay),
              .by_arrival = true};
  }
  placed.error_bound_ns = std::max(placed.error_bound_ns, round_ns(lateness));
  return placed;
}

double ClockFit::residual_ns(const StampPair& pair) const noexcept {
  const auto x = static_cast<double>(pair.device_ns - line_.origin.device_ns);
  const auto y = static_cast<double>(pair.arrival_ns - line_.origin.arrival_ns);
  return y - x - line_.drift * x - line_.offset_ns;
}

bool ClockFit::is_outlier(double residual_ns, double bound_ns) const noexcept {
  const double median = spread_.median_ns();
  if (residual_ns >= 0.0) {
    return residual_ns > std::max(to_ns(config_.min_gate), kLateGateMedians * median) + bound_ns;
  }
  // The first samples may have been held up together: whatever comes earlier than they did is
  // nearer the truth.
  const bool starting =
      since_lock_ < static_cast<std::uint64_t>(config_.jump_samples) && counters_.jumps == 0;
  const double gate = starting
                          ? to_ns(config_.max_delay)
                          : std::max(to_ns(config_.min_early_gate), kEarlyGateMedians * median);
  return residual_ns < -gate - bound_ns;
}

double ClockFit::bound_ns(std::int64_t device_ns) const noexcept {
  const double median = spread_.median_ns();
  const double first = std::max(to_ns(config_.first_bound), kEarlyGateMedians * median);
  const double unseen =
      std::max(kUnseenEnvelope * median, first / static_cast<double>(since_lock_));
  const double age = std::abs(static_cast<double>(device_ns - line_.origin.device_ns));
  return unseen + line_.scatter_ns + to_ns(config_.resolution) + age * line_.drift_error;
}

}  // namespace geoflow::timesync
