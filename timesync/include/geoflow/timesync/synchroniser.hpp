#pragma once

#include <cstdint>
#include <optional>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_model.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/depth_pairing.hpp"
#include "geoflow/timesync/stream_lane.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

namespace geoflow::timesync {

/// Makes one SyncedPacket of each colour frame: the depth frame that belongs to it, and the IMU,
/// leg and body-velocity samples since the packet before.
///
/// Where colour is silent and others are heard, packets without images go on at an interval of
/// their own, so that motion can be reckoned through any time without a camera. They wait as long
/// as others would (SynchroniserConfig::max_wait), so that the first frame after the silence comes
/// in time.
///
/// A packet is complete when on every stream that is alive a sample at or after its t has come (for
/// depth also the next colour frame, where that could have the better claim to it). It goes out
/// then, or when its wait is over. Packets leave in strictly increasing t, numbered without gaps.
/// Samples that come late, twice, out of order or broken are put right or dropped and counted:
/// every pushed sample ends in a packet or in exactly one counter (StreamCounters).
///
/// Thread-bound; no clock inside: `now` is the host's time on the line of the arrivals (in replay,
/// the arrival of the last sample). Deterministic: the same calls give the same packets. Memory is
/// bounded by the configuration.
class Synchroniser {
 public:
  Synchroniser(const SynchroniserConfig& config, const SynchroniserStreams& streams);

  void push_color(const Arrival<CameraClock, ColorFrame>& frame);
  void push_depth(const Arrival<CameraClock, DepthFrame>& frame);
  /// These say where on the host's time line the sample was placed, if it was taken.
  std::optional<Timed<ImuSample>> push_imu(const Arrival<ImuClock, ImuSample>& sample);
  std::optional<Timed<LegSample>> push_legs(const Arrival<LegClock, LegSample>& sample);
  std::optional<Timed<BodyVelocitySample>> push_body_velocity(
      const Arrival<LegClock, BodyVelocitySample>& sample);

  /// The next packet that is complete, or whose wait is over at `now`. Call until it gives none.
  [[nodiscard]] std::optional<SyncedPacket> pop(HostTime now);

  /// When the wait of the oldest colour frame is over: pop then at the latest. None while there is
  /// no colour frame: what goes out then goes out when a sample comes.
  [[nodiscard]] std::optional<HostTime> deadline() const;

  /// At the end of the streams: what is left, one packet a call; then none, and all samples left
  /// over count as unused.
  [[nodiscard]] std::optional<SyncedPacket> flush();

  [[nodiscard]] const SynchroniserCounters& counters() const noexcept { return counters_; }

 private:
  /// What images are later by than IMU samples of the same clock, from `t_device` of a frame that
  /// the camera's clock model knows; zero where they do not share one. It changes by little from
  /// call to call, so that frames stay in order.
  [[nodiscard]] Duration camera_lag(DeviceTime<CameraClock> t_device) noexcept;
  void note_arrival(HostTime t_arrival) noexcept;
  void note_color(HostTime t_arrival) noexcept;
  [[nodiscard]] std::optional<HostTime> next_color() const;
  [[nodiscard]] DepthChoice depth_for(HostTime t) const;
  [[nodiscard]] bool is_complete(HostTime t, HostTime now);
  [[nodiscard]] bool must_see_next_color(HostTime t) const;
  [[nodiscard]] SyncedPacket take_packet();
  void take_depth(SyncedPacket& packet);
  /// The next instant of a packet without images: an interval after the last one, or where, later
  /// than that, samples begin. None where there are none.
  [[nodiscard]] std::optional<HostTime> next_blind() const;
  [[nodiscard]] std::optional<SyncedPacket> pop_blind(HostTime now);
  [[nodiscard]] SyncedPacket take_blind(HostTime t, HostTime now);
  void take_samples(SyncedPacket& packet);
  void give_up_depth_before(HostTime t);

  SynchroniserConfig config_;
  Duration timeshift_cam_imu_;
  bool one_clock_;       // of camera and IMU
  Duration camera_lag_;  // see camera_lag()
  ClockModel<CameraClock> camera_clock_;
  ClockModel<ImuClock> imu_clock_;
  ClockModel<LegClock> leg_clock_;
  StreamLane<ColorFrame> color_;
  StreamLane<DepthFrame> depth_;
  StreamLane<ImuSample> imu_;
  StreamLane<LegSample> legs_;
  StreamLane<BodyVelocitySample> body_velocity_;
  SynchroniserCounters counters_;
  std::optional<HostTime> last_t_;           // of the last packet
  std::optional<HostTime> last_color_;       // arrival of the last colour frame
  std::optional<HostTime> listening_since_;  // first arrival, at all or after colour was silent
};

}  // namespace geoflow::timesync
