#pragma once

#include <chrono>
#include <cstdint>

#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/block_minima.hpp"
#include "geoflow/timesync/delay_spread.hpp"
#include "geoflow/timesync/jump_detector.hpp"

/// The line from one device clock to the host's, from stamps that arrive late.
///
/// A sample stamped x by its device reaches the host at y = a + (1 + b) x + d, where the delay d is
/// at least the transport's smallest (taken as 0: what a constant part of it would be cannot be
/// observed; see min_delay) and otherwise as it pleases. So a and b are those of the line *under*
/// all (x, y), not through their middle:
///
///   residual      r = y - a - (1 + b) x                                     how late this sample
///   is lowest        of each block of device time (1 s) the sample of least r  (sparse minima:
///   O(1) memory) refit         at each block's end: lower envelope of the last 32 lowest samples
///   (lower_envelope.hpp) in between    a sample with r < 0 lowers a by -r at once (the line stays
///   an envelope) error bound   e(x) = max(c J, D / n) + S + s + |x - x0| ((S + c J + s) / span +
///   w)
///
/// J: median delay above the line; c = 1/4. D: bound of the first sample; n: samples since the
/// lock. S: mean height of the block minima over the line. s: the stamps' resolution. w: how fast
/// an oscillator wanders (1 ppm, as chrony assumes). x0: the newest block minimum. Until the blocks
/// tell the rate better than it is known (at first: 0 to within the largest drift that is allowed)
/// b is kept and the fit moves a only.
///
/// A sample that lies off the line by more than the gate is an outlier: it does not touch the line.
/// Several in a row that agree with one another over some device time are a jump of the clock (or
/// its restart): the line moves onto them, b is kept, n starts anew, and the jump is counted.
/// Delivery that stalls and then comes in a burst is no jump: its residuals do not agree, they fall
/// from sample to sample. The habits (bound on every converted time, gates by the running spread
/// and not by a fixed threshold, a fit that resets when it misses) are those of chrony's hwclock.c
/// and quantiles.c.
namespace geoflow::timesync {

/// What the fit may assume. The defaults fit USB and CAN devices.
struct ClockFitConfig {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member
  Duration first_bound =
      std::chrono::milliseconds{20};  ///< error bound of the first sample: a usual largest delay
  Duration min_delay = Duration::zero();  ///< known smallest delay from exposure to arrival
  Duration resolution = std::chrono::microseconds{1};  ///< step of the device's stamps
  Duration block = std::chrono::seconds{1};  ///< device time of which the lowest sample is kept
  Duration min_gate =
      std::chrono::milliseconds{5};  ///< a sample less late than this is never an outlier
  Duration min_early_gate = std::chrono::milliseconds{1};  ///< nor one less early than this
  Duration max_delay =
      std::chrono::seconds{2};  ///< a sample later than this is placed by its arrival
  double max_drift = 300e-6;    ///< largest |b|
  int jump_samples = 8;         ///< a jump is believed after so many that agree…
  Duration jump_span = std::chrono::milliseconds{200};  ///< …over so much device time,
  Duration late_jump_span = std::chrono::seconds{
      1  // NOLINTEND(readability-magic-numbers)
  };  ///< or this much if it could also be a slow transport
};

/// Where a stamp lies on the host's time line.
struct Placed {
  std::int64_t t_ns = 0;
  std::int64_t error_bound_ns = 0;
  bool by_arrival =
      false;  ///< the stamp could not be believed: its order among other stamps says nothing
};

/// Bookkeeping of one clock. Counters never decrease.
struct ClockCounters {
  std::uint64_t samples = 0;   ///< pairs given to the fit
  std::uint64_t outliers = 0;  ///< pairs too far off the line to be used
  std::uint64_t jumps =
      0;  ///< times that the device clock jumped or restarted and was locked again
};

/// The fit in bare nanoseconds, on an unwrapped device count; see the head of this file. ClockModel
/// gives it types. Thread-bound. No allocation; amortised O(1) a sample.
class ClockFit {
 public:
  explicit ClockFit(const ClockFitConfig& config = {}) noexcept : config_{config} {}

  /// Takes one pair and places it: by the line, but never after its arrival; by its arrival where
  /// the two cannot belong together (see max_delay). Both must be plausible stamps (wrap.hpp).
  Placed add(std::int64_t device_ns, std::int64_t arrival_ns) noexcept;

  /// Places a stamp without learning from it. Before the first add() the bound is the largest
  /// Duration.
  [[nodiscard]] Placed place(std::int64_t device_ns) const noexcept;

  /// The device count that is to be expected with a sample arriving then (0 before the first
  /// add()).
  [[nodiscard]] std::int64_t expect_device_ns(std::int64_t arrival_ns) const noexcept;

  [[nodiscard]] bool locked() const noexcept { return since_lock_ > 0; }
  [[nodiscard]] std::int64_t newest_device_ns() const noexcept { return newest_.device_ns; }
  [[nodiscard]] double drift() const noexcept { return line_.drift; }                    ///< b
  [[nodiscard]] double median_delay_ns() const noexcept { return spread_.median_ns(); }  ///< J
  [[nodiscard]] const ClockCounters& counters() const noexcept { return counters_; }

 private:
  struct Line {  // host = origin.arrival + (x - origin.device) (1 + drift) + offset
    StampPair origin;
    double offset_ns = 0;
    double drift = 0;
    double scatter_ns = 0;   // S
    double drift_error = 0;  // (S + c J + s) / span + w
  };

  void lock(const StampPair& pair) noexcept;
  void accept(const StampPair& pair, double residual_ns) noexcept;
  void refit() noexcept;
  [[nodiscard]] double drift_error_of(double scatter_ns, double span_ns) const noexcept;
  [[nodiscard]] bool jumped(const StampPair& pair, double residual_ns) noexcept;
  [[nodiscard]] Placed place_doubtful(const StampPair& pair, double residual_ns) const noexcept;
  [[nodiscard]] double residual_ns(const StampPair& pair) const noexcept;
  [[nodiscard]] bool is_outlier(double residual_ns, double bound_ns) const noexcept;
  [[nodiscard]] double bound_ns(std::int64_t device_ns) const noexcept;

  ClockFitConfig config_;
  ClockCounters counters_;
  Line line_;
  std::uint64_t since_lock_ = 0;  // accepted samples; 0: never locked
  StampPair newest_;
  BlockMinima minima_;
  DelaySpread spread_;
  JumpDetector jump_;
};

}  // namespace geoflow::timesync
