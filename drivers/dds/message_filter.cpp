#include "dds/message_filter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/low_state.hpp"

namespace geoflow::drivers::dds {
namespace {

// A tick that is further than this many usual steps, and this long, from the one before has lost
// some between: whole milliseconds and a scheduler's jitter make steps of 1 to 3 ms of 2.
constexpr double kGapSteps = 2.5;
constexpr std::int32_t kGapMs = 5;
constexpr double kStepShare = 1.0 / 64;  // of a new step in the usual one

Duration since_start(std::uint32_t tick) {
  return std::chrono::milliseconds{tick};
}

/// Whether joints and IMU say the very same.
bool has_same_values(const LowState& a, const LowState& b) {
  const auto same_motor = [](const MotorState& x, const MotorState& y) {
    return x.q == y.q && x.dq == y.dq && x.tau_est == y.tau_est;
  };
  return std::ranges::equal(a.motor_state, b.motor_state, same_motor) &&
         a.foot_force == b.foot_force && a.imu_state.gyroscope == b.imu_state.gyroscope &&
         a.imu_state.accelerometer == b.imu_state.accelerometer;
}

}  // namespace

void MessageFilter::opened(HostTime now) {
  failure_.reset();
  last_.reset();
  listening_since_ = now;
}

void MessageFilter::note(HostTime now, std::string what) {
  trouble_ = Trouble{.t = now, .what = std::move(what)};
}

std::optional<RobotSample> MessageFilter::take(std::span<const std::byte> cdr, HostTime t_arrival) {
  const auto state = decode(cdr);
  if (!state) {
    ++counters_.malformed;
    note(t_arrival, state.error().message);
    return std::nullopt;
  }
  if (!is_intact(*state, t_arrival) || is_duplicate(*state, t_arrival)) {
    return std::nullopt;
  }
  const auto legs = legs_of(*state);
  const auto imu = imu_of(*state);
  if (!legs || !imu) {
    ++counters_.malformed;
    note(t_arrival, legs ? imu.error().message : legs.error().message);
    return std::nullopt;
  }
  watch_tick(state->tick, t_arrival);
  last_ = *state;
  last_accepted_ = t_arrival;
  ++counters_.accepted;
  const Duration tick = since_start(state->tick);
  return RobotSample{
      .legs = {.t_device = DeviceTime<LegClock>{tick}, .t_arrival = t_arrival, .sample = *legs},
      .imu = {.t_device = DeviceTime<ImuClock>{tick}, .t_arrival = t_arrival, .sample = *imu}};
}

bool MessageFilter::is_intact(const LowState& state, HostTime now) {
  if (checksum(state) == state.crc) {
    sums_were_right_ = true;
    return true;
  }
  if (!sums_were_right_) {
    ++counters_.unchecked;
    return true;
  }
  ++counters_.damaged;
  note(now, fmt::format("{}: messages had a wrong checksum and were dropped", where_));
  return false;
}

bool MessageFilter::is_duplicate(const LowState& state, HostTime now) {
  const bool same_values = last_ && has_same_values(state, *last_);
  if (!same_values) {
    changed_ = now;
  }
  const bool same_tick = last_ && last_->tick == state.tick;
  const bool repeated = same_values && now - changed_.value_or(now) <= kLongestRepetition;
  if (!same_tick && !repeated) {
    return false;
  }
  ++counters_.duplicates;
  if (!same_tick) {
    watch_tick(state.tick, now);
    last_->tick = state.tick;
  }
  return true;
}

void MessageFilter::watch_tick(std::uint32_t tick, HostTime now) {
  if (!last_) {
    return;
  }
  // Modulo 2^32: right over the wrap; negative where the clock has begun anew.
  const auto step = static_cast<std::int32_t>(tick - last_->tick);
  if (step < 0) {
    ++counters_.restarts;
    step_ms_ = 0;
    note(now, fmt::format("{}: the robot's clock has begun anew", where_));
    return;
  }
  if (step_ms_ > 0 && step >= kGapMs && step > kGapSteps * step_ms_) {
    const auto lost = static_cast<std::uint64_t>(std::max(std::lround(step / step_ms_) - 1, 1L));
    counters_.lost += lost;
    note(now, fmt::format("{}: {} messages were lost", where_, lost));
    return;
  }
  step_ms_ = step_ms_ > 0 ? step_ms_ + kStepShare * (step - step_ms_) : step;
}

MessageFilter::Report MessageFilter::assess(HostTime now, std::uint32_t writers) const {
  if (failure_) {
    return {.state = SourceState::kFailed, .reason = *failure_};
  }
  const HostTime since = std::max(last_accepted_.value_or(listening_since_), listening_since_);
  if (now - since > kSilence) {
    if (trouble_ && now - trouble_->t <= kMemory) {
      return {.state = SourceState::kFailed, .reason = trouble_->what};
    }
    return {
        .state = SourceState::kFailed,
        .reason = writers > 0
                      ? fmt::format("{}: the robot is there, but sends nothing", where_)
                      : fmt::format("{}: no robot sends it. Is it on, is this the interface that "
                                    "it is connected to, and is its address in the robot's net "
                                    "(192.168.123.0/24)?",
                                    where_)};
  }
  if (trouble_ && now - trouble_->t <= kMemory) {
    return {.state = SourceState::kDegraded, .reason = trouble_->what};
  }
  return {};
}

}  // namespace geoflow::drivers::dds
