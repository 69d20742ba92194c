#include "geoflow/timesync/synchroniser.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/depth_pairing.hpp"
#include "geoflow/timesync/liveness.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"
#include "geoflow/timesync/wrap.hpp"

namespace geoflow::timesync {
namespace {

Liveness liveness(const SynchroniserConfig& config, bool expected) {
  return {expected, config.silent_after};
}

}  // namespace

Synchroniser::Synchroniser(const SynchroniserConfig& config, const SynchroniserStreams& streams)
    : config_{config},
      timeshift_cam_imu_{streams.timeshift_cam_imu},
      one_clock_{streams.imu_on_camera_clock && streams.imu &&
                 streams.imu->domain == StampDomain::kDevice &&
                 streams.camera.domain == StampDomain::kDevice},
      camera_lag_{},
      camera_clock_{streams.camera, config.clock},
      imu_clock_{streams.imu.value_or(StampInfo{}), config.clock},
      leg_clock_{streams.legs.value_or(StampInfo{}), config.clock},
      color_{config.frame_capacity, config.max_step, liveness(config, true)},
      depth_{config.frame_capacity, config.max_step, liveness(config, true)},
      imu_{config.sample_capacity, config.max_step, liveness(config, streams.imu.has_value())},
      legs_{config.sample_capacity, config.max_step, liveness(config, false)},
      body_velocity_{config.sample_capacity, config.max_step, liveness(config, false)} {}

/// A line lies under its stream's arrivals, so it contains that stream's least delay: for an image
/// that of exposure, readout and transfer. Of two lines of one clock the earlier is nearer the
/// truth.
Duration Synchroniser::camera_lag(DeviceTime<CameraClock> t_device) noexcept {
  constexpr Duration kLargest = std::chrono::milliseconds{300};  // an exposure, and its way here
  constexpr Duration kStep = std::chrono::milliseconds{1};
  if (!one_clock_ || !camera_clock_.locked() || !imu_clock_.locked()) {
    return camera_lag_;
  }
  const HostTime by_camera = camera_clock_.to_host(t_device).t;
  const HostTime by_imu = imu_clock_.to_host(DeviceTime<ImuClock>{t_device.time_since_epoch()}).t;
  const Duration lag = by_camera - by_imu;
  if (lag <= kLargest && lag >= -kLargest) {  // else one of them has not seen the clock's jump yet
    const Duration wanted = std::max(lag, Duration::zero());
    camera_lag_ += std::clamp(wanted - camera_lag_, -kStep, kStep);
  }
  return camera_lag_;
}

void Synchroniser::push_color(const Arrival<CameraClock, ColorFrame>& frame) {
  note_arrival(frame.t_arrival);
  note_color(frame.t_arrival);
  color_.push(frame, camera_clock_, camera_lag(frame.t_device), counters_.color);
  counters_.camera_clock = camera_clock_.counters();
}

void Synchroniser::push_depth(const Arrival<CameraClock, DepthFrame>& frame) {
  note_arrival(frame.t_arrival);
  depth_.push(frame, camera_clock_, camera_lag(frame.t_device), counters_.depth);
  counters_.camera_clock = camera_clock_.counters();
}

std::optional<Timed<ImuSample>> Synchroniser::push_imu(const Arrival<ImuClock, ImuSample>& sample) {
  note_arrival(sample.t_arrival);
  auto placed = imu_.push(sample, imu_clock_, timeshift_cam_imu_, counters_.imu);
  counters_.imu_clock = imu_clock_.counters();
  return placed;
}

std::optional<Timed<LegSample>> Synchroniser::push_legs(
    const Arrival<LegClock, LegSample>& sample) {
  note_arrival(sample.t_arrival);
  auto placed = legs_.push(sample, leg_clock_, Duration::zero(), counters_.legs);
  counters_.leg_clock = leg_clock_.counters();
  return placed;
}

std::optional<Timed<BodyVelocitySample>> Synchroniser::push_body_velocity(
    const Arrival<LegClock, BodyVelocitySample>& sample) {
  note_arrival(sample.t_arrival);
  auto placed = body_velocity_.push(sample, leg_clock_, Duration::zero(), counters_.body_velocity);
  counters_.leg_clock = leg_clock_.counters();
  return placed;
}

std::optional<SyncedPacket> Synchroniser::pop(HostTime now) {
  if (!is_plausible_stamp_ns(now.time_since_epoch().count())) {
    return std::nullopt;
  }
  const std::optional<HostTime> due = deadline();
  if (!due) {
    return pop_blind(now);
  }
  if (!is_complete(color_.buffer.front().timed.t, now)) {
    if (now < *due) {
      return std::nullopt;
    }
    ++counters_.wait_expired;
  }
  return take_packet();
}

std::optional<HostTime> Synchroniser::deadline() const {
  if (color_.buffer.empty()) {
    return std::nullopt;
  }
  return color_.buffer.front().t_arrival + config_.max_wait;
}

std::optional<SyncedPacket> Synchroniser::flush() {
  if (!color_.buffer.empty()) {
    return take_packet();
  }
  depth_.buffer.drop(depth_.buffer.size(), counters_.depth);
  imu_.buffer.drop(imu_.buffer.size(), counters_.imu);
  legs_.buffer.drop(legs_.buffer.size(), counters_.legs);
  body_velocity_.buffer.drop(body_velocity_.buffer.size(), counters_.body_velocity);
  return std::nullopt;
}

void Synchroniser::note_arrival(HostTime t_arrival) noexcept {
  if (!listening_since_ && is_plausible_stamp_ns(t_arrival.time_since_epoch().count())) {
    listening_since_ = t_arrival;
  }
}

/// Where colour itself was silent, the others' silence of that time says nothing: the whole camera
/// was away.
void Synchroniser::note_color(HostTime t_arrival) noexcept {
  if (!is_plausible_stamp_ns(t_arrival.time_since_epoch().count())) {
    return;
  }
  if (last_color_ && t_arrival - *last_color_ > config_.silent_after) {
    listening_since_ = t_arrival;
  }
  last_color_ = t_arrival;
}

std::optional<HostTime> Synchroniser::next_color() const {
  return color_.buffer.size() > 1 ? std::optional{color_.buffer[1].timed.t} : std::nullopt;
}

DepthChoice Synchroniser::depth_for(HostTime t) const {
  return choose_depth(depth_.buffer, t, config_.depth_tolerance, next_color(), config_.share_depth);
}

bool Synchroniser::is_complete(HostTime t, HostTime now) {
  const HostTime since = listening_since_.value_or(now);
  // Not short-circuited: each asks whether its stream fell silent, and counts that.
  const bool depth = depth_.is_ready(t, now, since, counters_.depth);
  const bool imu = imu_.is_ready(t, now, since, counters_.imu);
  const bool legs = legs_.is_ready(t, now, since, counters_.legs);
  const bool body_velocity = body_velocity_.is_ready(t, now, since, counters_.body_velocity);
  return depth && imu && legs && body_velocity && !must_see_next_color(t);
}

/// Whether a colour frame that has not come yet could be nearer to the chosen depth frame: only if,
/// at the rate of late, one may fall within twice the depth frame's distance.
bool Synchroniser::must_see_next_color(HostTime t) const {
  if (!last_t_ || next_color()) {
    return false;
  }
  const DepthChoice choice = depth_for(t);
  if (!choice.index) {
    return false;
  }
  constexpr int kEarliestNumerator = 3;  // a next frame may come a quarter of the interval early
  constexpr int kEarliestDenominator = 4;
  const Duration earliest_next = (t - *last_t_) * kEarliestNumerator / kEarliestDenominator;
  return 2 * (depth_.buffer[*choice.index].timed.t - t) > earliest_next;
}

std::optional<HostTime> Synchroniser::next_blind() const {
  std::optional<HostTime> first;
  const auto look = [&](const auto& lane) {
    const std::size_t i = last_t_ ? lane.buffer.upper_bound(*last_t_) : 0;
    if (i < lane.buffer.size()) {
      const HostTime t = lane.buffer[i].timed.t;
      first = first ? std::min(*first, t) : t;
    }
  };
  look(imu_);
  look(legs_);
  look(body_velocity_);
  return first && last_t_ ? std::max(*first, *last_t_ + config_.blind_interval) : first;
}

std::optional<SyncedPacket> Synchroniser::pop_blind(HostTime now) {
  const HostTime since = listening_since_.value_or(now);
  const std::optional<HostTime> t = next_blind();
  if (!t || now - *t < config_.max_wait || color_.is_alive(now, since, counters_.color)) {
    return std::nullopt;
  }
  return take_blind(*t, now);
}

SyncedPacket Synchroniser::take_blind(HostTime t, HostTime now) {
  SyncedPacket packet;
  packet.t = t;
  packet.t_arrival = now;
  packet.sequence = counters_.packets;
  take_samples(packet);
  give_up_depth_before(t);
  color_.buffer.set_horizon(t);
  last_t_ = t;
  ++counters_.packets;
  ++counters_.blind;
  return packet;
}

void Synchroniser::take_samples(SyncedPacket& packet) {
  packet.imu = imu_.take_window(last_t_, packet.t, counters_.imu);
  packet.legs = legs_.take_window(last_t_, packet.t, counters_.legs);
  packet.body_velocity = body_velocity_.take_window(last_t_, packet.t, counters_.body_velocity);
}

SyncedPacket Synchroniser::take_packet() {
  auto& front = color_.buffer.front();
  SyncedPacket packet;
  packet.t = front.timed.t;
  packet.error_bound = front.timed.error_bound;
  packet.sequence = counters_.packets;
  packet.color = front.timed.sample.image;
  packet.t_arrival = front.t_arrival;
  take_depth(packet);
  take_samples(packet);
  front.used = true;
  ++counters_.color.used;
  color_.buffer.drop(1, counters_.color);
  color_.buffer.set_horizon(packet.t, true);
  last_t_ = packet.t;
  ++counters_.packets;
  return packet;
}

void Synchroniser::take_depth(SyncedPacket& packet) {
  const DepthChoice choice = depth_for(packet.t);
  if (choice.index) {
    auto& depth = depth_.buffer[*choice.index];
    packet.depth = depth.timed.sample.image;
    packet.depth_offset = depth.timed.t - packet.t;
    packet.t_arrival = std::max(packet.t_arrival, depth.t_arrival);
    counters_.depth_shared += depth.used ? 1U : 0U;
    counters_.depth.used += depth.used ? 0U : 1U;
    depth.used = true;
    depth.claimed = depth.claimed || choice.own;
  } else {
    ++counters_.depth_missing;
  }
  give_up_depth_before(packet.t);
}

void Synchroniser::give_up_depth_before(HostTime t) {
  const HostTime out_of_reach = t - config_.depth_tolerance;
  depth_.buffer.drop(depth_.buffer.upper_bound(out_of_reach), counters_.depth);
  depth_.buffer.set_horizon(out_of_reach);
}

}  // namespace geoflow::timesync
