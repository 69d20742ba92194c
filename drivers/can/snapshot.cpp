#include "can/snapshot.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/dbc/signal.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can {
namespace {

/// Rounds that frames may belong to at once.
constexpr std::size_t kOpenRounds = 2;
/// A leg's counter may be so far ahead of SYNC's newest: SYNCs are lost now and then.
constexpr std::int64_t kAheadOfSync = 2;
/// SYNC's counter so far back is a repetition; further back it has begun anew.
constexpr std::int64_t kRepeatedSync = -2;

bool all(const auto& flags, std::size_t first, std::size_t count) {
  return std::all_of(std::next(flags.begin(), static_cast<std::ptrdiff_t>(first)),
                     std::next(flags.begin(), static_cast<std::ptrdiff_t>(first + count)),
                     [](bool flag) { return flag; });
}

}  // namespace

SnapshotAssembler::SnapshotAssembler(const LegDictionary& dictionary, const AssemblyConfig& config)
    : dictionary_{dictionary},
      config_{config},
      counted_{std::ranges::any_of(
          dictionary.groups(), [](const FieldGroup& group) { return group.sequence.has_value(); })},
      group_heard_(dictionary.groups().size()) {}

StampInfo SnapshotAssembler::stamps() const {
  const auto& sync = dictionary_.sync();
  return counted_ && sync && sync->time
             ? StampInfo{.domain = StampDomain::kDevice, .wrap = sync->period}
             : StampInfo{};
}

FrameKind SnapshotAssembler::push(const Received& received) {
  const LegDictionary::Match match = dictionary_.match(received.frame);
  if (match.kind == FrameKind::kTooShort) {
    ++counters_.too_short;
  }
  if (match.kind != FrameKind::kSync && match.kind != FrameKind::kLeg) {
    return match.kind;
  }
  if (!last_accepted_ || received.t_arrival - *last_accepted_ > config_.restart_after) {
    counters_.restarts += last_accepted_ ? 1U : 0U;
    restart(received.t_arrival);
  }
  const bool accepted =
      match.kind == FrameKind::kSync ? take_sync(received) : take_values(match.group, received);
  if (accepted) {
    last_accepted_ = received.t_arrival;
  }
  return match.kind;
}

void SnapshotAssembler::restart(HostTime t) {
  finish();
  newest_.reset();
  newest_sync_.reset();
  closed_.reset();
  placed_.reset();
  round_period_ = {};
  leg_round_.fill(std::nullopt);
  // What there is, is found out by listening for a while.
  std::ranges::fill(group_heard_, t);
  last_accepted_ = t;
}

void SnapshotAssembler::finish() {
  while (!open_.empty()) {
    close_front();
  }
}

std::int64_t SnapshotAssembler::unwrapped(std::uint64_t counter, std::size_t bits) const noexcept {
  if (!newest_) {
    return static_cast<std::int64_t>(counter);
  }
  const std::int64_t period = std::int64_t{1} << bits;
  const std::int64_t half = period / 2;
  std::int64_t ahead = (static_cast<std::int64_t>(counter) - *newest_) % period;
  if (ahead < -half) {
    ahead += period;
  } else if (ahead >= half) {
    ahead -= period;
  }
  return *newest_ + ahead;
}

bool SnapshotAssembler::take_sync(const Received& received) {
  const auto& found = dictionary_.sync();
  if (!counted_ || !found) {
    return true;
  }
  const SyncMessage& sync = *found;
  const auto payload = received.frame.payload();
  const std::uint64_t counter = sync.sequence.raw(payload);
  std::int64_t number = unwrapped(counter, sync.sequence.field.bits);
  if (newest_sync_ && number - *newest_sync_ < kRepeatedSync) {
    ++counters_.restarts;
    restart(received.t_arrival);
    number = unwrapped(counter, sync.sequence.field.bits);
  }
  if (newest_sync_ && number <= *newest_sync_) {
    return true;  // a second bus repeats it
  }
  newest_sync_ = number;
  std::optional<Duration> device_time;
  if (sync.time) {
    device_time = from_seconds(sync.time->decode(payload));
    if (placed_) {
      Duration step = (*device_time - placed_->device_time) % sync.period;
      step += step < Duration::zero() ? sync.period : Duration::zero();
      round_period_ = step / (number - placed_->number);
    }
    placed_ = PlacedRound{.number = number, .device_time = *device_time};
  }
  if (!closed_ || number > *closed_) {
    Round& round = open_round(number, received.t_arrival);
    round.t_sync = received.t_arrival;
    round.device_time = device_time;
  }
  return true;
}

bool SnapshotAssembler::take_values(std::size_t group, const Received& received) {
  const FieldGroup& fields = dictionary_.groups()[group];
  const auto leg = static_cast<std::size_t>(fields.leg);
  Round* const round =
      counted_ ? counted_round(group, received) : arriving_round(group, received.t_arrival);
  if (round == nullptr) {
    return false;
  }
  if (round->heard[group]) {
    ++counters_.duplicate;
    return false;
  }
  round->heard[group] = true;
  round->t_last = std::max(round->t_last, received.t_arrival);
  group_heard_[group] = received.t_arrival;
  leg_heard_[leg] = received.t_arrival;
  fill(*round, fields, received.frame);
  return true;
}

SnapshotAssembler::Round* SnapshotAssembler::counted_round(std::size_t group,
                                                           const Received& received) {
  const FieldGroup& fields = dictionary_.groups()[group];
  std::optional<std::int64_t>& of_leg = leg_round_[static_cast<std::size_t>(fields.leg)];
  if (fields.sequence) {
    const dbc::Signal& sequence = *fields.sequence;
    const std::int64_t number =
        unwrapped(sequence.raw(received.frame.payload()), sequence.field.bits);
    if (newest_sync_ && number > *newest_sync_ + kAheadOfSync) {
      ++counters_.out_of_step;
      leg_out_of_step_[static_cast<std::size_t>(fields.leg)] = received.t_arrival;
      of_leg.reset();
      return nullptr;
    }
    of_leg = number;
  }
  if (!of_leg) {
    ++counters_.unattributed;
    return nullptr;
  }
  if (closed_ && *of_leg <= *closed_) {
    ++counters_.late;
    return nullptr;
  }
  return &open_round(*of_leg, received.t_arrival);
}

SnapshotAssembler::Round* SnapshotAssembler::arriving_round(std::size_t group, HostTime t) {
  if (!open_.empty() && open_.back().heard[group]) {
    close_front();
  }
  if (open_.empty()) {
    return &open_round(newest_ ? *newest_ + 1 : 0, t);
  }
  return &open_.back();
}

SnapshotAssembler::Round& SnapshotAssembler::open_round(std::int64_t number, HostTime t) {
  newest_ = std::max(newest_.value_or(number), number);
  auto at = std::ranges::lower_bound(open_, number, {}, &Round::number);
  if (at != open_.end() && at->number == number) {
    return *at;
  }
  if (open_.size() >= kOpenRounds && at != open_.begin()) {
    close_front();
    at = std::ranges::lower_bound(open_, number, {}, &Round::number);
  }
  Round round{.number = number, .t_first = t, .t_last = t};
  round.heard.assign(group_heard_.size(), false);
  return *open_.insert(at, std::move(round));
}

void SnapshotAssembler::fill(Round& round, const FieldGroup& group, const Frame& frame) {
  for (const LegField& field : group.fields) {
    const double value = field.signal.decode(frame.payload());
    if (!field.signal.is_plausible(value)) {
      ++counters_.implausible;
      continue;
    }
    switch (field.quantity) {
      case Quantity::kAngle:
        round.sample.joints[field.index].q_rad = value;
        round.has_angle[field.index] = true;
        break;
      case Quantity::kRate:
        round.sample.joints[field.index].dq_radps = value;
        round.has_rate[field.index] = true;
        break;
      case Quantity::kTorque:
        round.sample.joints[field.index].tau_nm = value;
        break;
      case Quantity::kFootForce:
        round.sample.foot_force[field.index] = static_cast<float>(value);
        break;
    }
  }
}

bool SnapshotAssembler::is_complete(const Round& round, HostTime now) const {
  for (std::size_t group = 0; group < group_heard_.size(); ++group) {
    const auto& heard = group_heard_[group];
    const bool alive = heard && now - *heard <= config_.silent_after;
    if (alive && !round.heard[group]) {
      return false;
    }
  }
  return true;
}

std::optional<Arrival<LegClock, LegSample>> SnapshotAssembler::pop(HostTime now) {
  // A later round that is whole ends the wait for those before it: nodes send in order.
  std::size_t over = 0;
  for (std::size_t i = 0; i < open_.size(); ++i) {
    over = is_complete(open_[i], now) ? i + 1 : over;
  }
  for (; over > 0; --over) {
    close_front();
  }
  while (!open_.empty() && now - open_.front().t_first >= config_.most_wait) {
    close_front();
  }
  if (ready_.empty()) {
    return std::nullopt;
  }
  const auto sample = ready_.front();
  ready_.pop_front();
  return sample;
}

void SnapshotAssembler::close_front() {
  Round& round = open_.front();
  if (counted_ && closed_) {
    counters_.gaps += static_cast<std::uint64_t>(round.number - *closed_ - 1);
  }
  closed_ = round.number;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const std::size_t hip = leg * kJointsPerLeg;
    round.sample.valid[leg] =
        all(round.has_angle, hip, kJointsPerLeg) && all(round.has_rate, hip, kJointsPerLeg);
  }
  emit(round);
  open_.pop_front();
}

void SnapshotAssembler::emit(Round& round) {
  const auto& valid = round.sample.valid;
  if (std::ranges::none_of(valid, [](bool leg) { return leg; })) {
    ++counters_.empty;
    return;
  }
  const auto t_device = device_time_of(round);
  if (!t_device) {
    ++counters_.unplaced;
    return;
  }
  ++counters_.snapshots;
  counters_.incomplete += all(valid, 0, kLegCount) ? 0U : 1U;
  ready_.push_back({.t_device = DeviceTime<LegClock>{*t_device},
                    .t_arrival = round.t_sync.value_or(round.t_first),
                    .sample = round.sample});
}

std::optional<Duration> SnapshotAssembler::device_time_of(const Round& round) const {
  if (!counted_) {
    return (round.t_first + (round.t_last - round.t_first) / 2).time_since_epoch();
  }
  if (stamps().domain == StampDomain::kHost) {
    return round.t_sync.value_or(round.t_first).time_since_epoch();
  }
  const auto& sync = dictionary_.sync();
  if (round.device_time || !placed_ || !sync || round_period_ <= Duration::zero()) {
    return round.device_time;
  }
  const Duration period = sync->period;
  const Duration time =
      (placed_->device_time + (round.number - placed_->number) * round_period_) % period;
  return time < Duration::zero() ? time + period : time;
}

}  // namespace geoflow::drivers::can
