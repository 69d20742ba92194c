#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/synchroniser.hpp"

/// Samples for the synchroniser's tests, stamped in milliseconds; arrival equals the stamp unless
/// given.
namespace geoflow::timesync::tests {

inline constexpr ImageShape kTinyShape{.width = 2, .height = 1, .format = PixelFormat::kGray8};
inline constexpr std::size_t kPoolFrames = 512;

constexpr Duration from_ms(double value_ms) {
  return from_seconds(value_ms * 1e-3);
}
constexpr HostTime host_ms(double value_ms) {
  return HostTime{from_ms(value_ms)};
}
constexpr double to_ms(Duration duration) {
  return to_seconds(duration) * 1e3;
}

inline FrameRef tiny_frame() {
  static FramePool pool{kPoolFrames};
  return pool.acquire(kTinyShape);
}

template <typename Clock, typename Sample>
Arrival<Clock, Sample> arrival(double t_ms, Sample sample, double delay_ms = 0) {
  return {DeviceTime<Clock>{from_ms(t_ms)}, host_ms(t_ms + delay_ms), std::move(sample)};
}

inline Arrival<CameraClock, ColorFrame> color(double t_ms, double delay_ms = 0) {
  return arrival<CameraClock>(t_ms, ColorFrame{tiny_frame()}, delay_ms);
}
inline Arrival<CameraClock, DepthFrame> depth(double t_ms, double delay_ms = 0) {
  return arrival<CameraClock>(t_ms, DepthFrame{tiny_frame()}, delay_ms);
}
inline Arrival<ImuClock, ImuSample> imu(double t_ms, double delay_ms = 0) {
  return arrival<ImuClock>(t_ms, ImuSample{}, delay_ms);
}
inline Arrival<LegClock, LegSample> legs(double t_ms, double delay_ms = 0) {
  return arrival<LegClock>(t_ms, LegSample{}, delay_ms);
}
inline Arrival<LegClock, BodyVelocitySample> body_velocity(double t_ms, double delay_ms = 0) {
  return arrival<LegClock>(t_ms, BodyVelocitySample{}, delay_ms);
}

/// Everything that comes out at `now_ms`.
inline std::vector<SyncedPacket> pop_all(Synchroniser& synchroniser, double now_ms) {
  std::vector<SyncedPacket> packets;
  while (auto packet = synchroniser.pop(host_ms(now_ms))) {
    packets.push_back(*std::move(packet));
  }
  return packets;
}

inline std::vector<SyncedPacket> flush_all(Synchroniser& synchroniser) {
  std::vector<SyncedPacket> packets;
  while (auto packet = synchroniser.flush()) {
    packets.push_back(*std::move(packet));
  }
  return packets;
}

template <typename Sample>
std::vector<double> times_ms(const std::vector<Timed<Sample>>& samples) {
  std::vector<double> times;
  times.reserve(samples.size());
  for (const auto& sample : samples) {
    times.push_back(to_ms(sample.t.time_since_epoch()));
  }
  return times;
}

}  // namespace geoflow::timesync::tests
