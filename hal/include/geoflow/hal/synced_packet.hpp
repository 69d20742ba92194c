#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow {

/// All that the estimator needs for one camera frame, or, while there are none, for some time
/// without them: made by timesync, taken by slam.
struct SyncedPacket {
  HostTime t;                  ///< middle of the colour exposure; without images, its end
  Duration error_bound{};      ///< of t
  std::uint64_t sequence = 0;  ///< counts packets from 0, without gaps
  FrameRef color;              ///< empty while colour is silent
  FrameRef depth;  ///< the nearest depth frame within tolerance; empty where there was none
  Duration depth_offset{};  ///< t of depth minus t of colour
  HostTime
      t_arrival;  ///< when the last of the frames reached the host; without them, when it was made

  /// Samples in (previous packet's t, this t], in order, plus the nearest one at or before and the
  /// nearest at or after that interval where they exist, so that both ends can be interpolated.
  /// Empty where there is no such sensor.
  std::vector<Timed<ImuSample>> imu;
  std::vector<Timed<LegSample>> legs;
  std::vector<Timed<BodyVelocitySample>> body_velocity;
};

}  // namespace geoflow
