#pragma once

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/finite.hpp"
#include "geoflow/timesync/wrap.hpp"

namespace geoflow::timesync {

/// A bounded window of one stream, ordered by time, no two samples of one instant. Settles the fate
/// of each sample that it refuses or gives up (StreamCounters). Thread-bound. Allocates in the
/// constructor only; push and the trims are amortised O(1) for samples in order, O(displacement)
/// for reordered ones; searches are O(log n).
template <typename Sample>
class StreamBuffer {
 public:
  struct Entry {
    Timed<Sample> timed;
    HostTime t_arrival;
    bool used = false;     ///< has been in a packet
    bool claimed = false;  ///< depth: was in the packet of the colour frame that it is nearest to
  };

  /// Holds `capacity` (at least 1) samples. A stamp more than `max_step` ahead of the newest is
  /// refused unless the next one is near it: one corrupted stamp must not make all that follow look
  /// late.
  StreamBuffer(std::size_t capacity, Duration max_step)
      : ring_(capacity < 1 ? 1 : capacity), max_step_{max_step} {}

  /// Takes a sample if it is usable, new and in time; whether it did.
  bool push(Timed<Sample> timed, HostTime t_arrival, StreamCounters& counters) {
    ++counters.pushed;
    if (!is_plausible_stamp_ns(timed.t.time_since_epoch().count()) || !is_usable(timed.sample)) {
      ++counters.invalid;
      return false;
    }
    const std::size_t place = upper_bound(timed.t);
    if ((place > 0 && (*this)[place - 1].timed.t == timed.t) ||
        (horizon_ && exact_horizon_ && timed.t == *horizon_)) {
      ++counters.duplicate;
      return false;
    }
    if (horizon_ && timed.t <= *horizon_) {
      ++counters.late;
      return false;
    }
    if (is_outlier(timed.t)) {
      ++counters.outlier;
      return false;
    }
    if (size_ == ring_.size()) {
      if (place == 0) {
        ++counters.overflow;  // the new one is the oldest
        return false;
      }
      counters.overflow += front().used ? 0U : 1U;
      drop_front();
      insert(place - 1, Entry{std::move(timed), t_arrival}, counters);
    } else {
      insert(place, Entry{std::move(timed), t_arrival}, counters);
    }
    return true;
  }

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  /// The i-th sample, oldest first.
  [[nodiscard]] Entry& operator[](std::size_t i) noexcept {
    return ring_[(head_ + i) % ring_.size()];
  }
  [[nodiscard]] const Entry& operator[](std::size_t i) const noexcept {
    return ring_[(head_ + i) % ring_.size()];
  }
  [[nodiscard]] Entry& front() noexcept { return (*this)[0]; }
  [[nodiscard]] const Entry& front() const noexcept { return (*this)[0]; }

  /// The latest instant that was ever taken.
  [[nodiscard]] std::optional<HostTime> newest() const noexcept { return newest_; }

  /// Index of the first sample after `t`; size() if there is none.
  [[nodiscard]] std::size_t upper_bound(HostTime t) const noexcept {
    if (size_ == 0 || (*this)[size_ - 1].timed.t <= t) {
      return size_;  // the usual case: t is the newest
    }
    std::size_t low = 0;
    std::size_t high = size_;
    while (low < high) {
      const std::size_t middle = low + (high - low) / 2;
      if ((*this)[middle].timed.t <= t) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }

  /// From now on samples at or before `t` are late; one exactly at `t` is a duplicate if
  /// `taken_at_t`.
  void set_horizon(HostTime t, bool taken_at_t = false) noexcept {
    horizon_ = t;
    exact_horizon_ = taken_at_t;
  }

  /// Gives up the `count` oldest samples; those that were in no packet count as unused.
  void drop(std::size_t count, StreamCounters& counters) {
    for (; count > 0 && size_ > 0; --count) {
      counters.unused += front().used ? 0U : 1U;
      drop_front();
    }
  }

 private:
  [[nodiscard]] bool is_outlier(HostTime t) {
    const bool leaps = newest_ && t - *newest_ > max_step_;
    const bool confirmed =
        candidate_ && t - *candidate_ <= max_step_ && *candidate_ - t <= max_step_;
    if (leaps && !confirmed) {
      candidate_ = t;
      return true;
    }
    candidate_.reset();
    return false;
  }

  /// Precondition: there is room.
  void insert(std::size_t place, Entry&& entry, StreamCounters& counters) {
    counters.reordered += newest_ && entry.timed.t < *newest_ ? 1U : 0U;
    newest_ = newest_ && *newest_ > entry.timed.t ? *newest_ : entry.timed.t;
    for (std::size_t i = size_; i > place; --i) {
      (*this)[i] = std::move((*this)[i - 1]);
    }
    (*this)[place] = std::move(entry);
    ++size_;
  }

  void drop_front() {
    front() = Entry{};  // lets go of pooled memory
    head_ = (head_ + 1) % ring_.size();
    --size_;
  }

  std::vector<Entry> ring_;
  Duration max_step_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
  std::optional<HostTime> newest_;
  std::optional<HostTime> horizon_;
  bool exact_horizon_ = false;
  std::optional<HostTime> candidate_;
};

}  // namespace geoflow::timesync
