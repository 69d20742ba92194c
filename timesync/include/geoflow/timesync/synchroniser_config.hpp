#pragma once

#include <chrono>
#include <cstddef>
#include <optional>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/clock_fit.hpp"

namespace geoflow::timesync {

/// What the Synchroniser waits for, and how much it holds.
struct SynchroniserConfig {
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member
  /// Largest distance of a colour and a depth frame that make a pair. The association lists of the
  /// TUM RGB-D benchmark (eleven sequences, 18520 pairs) go up to 19.9 ms.
  Duration depth_tolerance = std::chrono::milliseconds{20};
  /// Whether a colour frame without a depth frame of its own may have one that another packet has
  /// as well.
  bool share_depth = true;
  /// A packet goes out incomplete so long after its colour frame's arrival.
  Duration max_wait = std::chrono::milliseconds{100};
  /// A stream that was not heard for so long is not waited for until it is heard again.
  Duration silent_after = std::chrono::milliseconds{500};
  /// Where colour is silent, packets without images are so far apart.
  Duration blind_interval = std::chrono::milliseconds{33};
  /// A stamp further ahead of its stream's newest is refused unless the next one agrees with it.
  Duration max_step = std::chrono::seconds{5};
  /// How many samples are held at most; then the oldest is given up and counted. Frames hold memory
  /// of their pool.
  std::size_t frame_capacity = 16;
  std::size_t sample_capacity = 4096;  ///< of IMU, legs, body velocity: 8 s at 500 Hz
  // NOLINTEND(readability-magic-numbers)
  ClockFitConfig clock{};  ///< for streams of StampDomain::kDevice
};

/// Which streams there are, and how they are stamped.
struct SynchroniserStreams {
  StampInfo camera{};              ///< colour and depth: one clock
  std::optional<StampInfo> imu{};  ///< none: there is no IMU, and it is not waited for
  /// Both are stamped by one device clock: what an image is later than an IMU sample on its way to
  /// the host can then be told, and is taken off.
  bool imu_on_camera_clock = false;
  std::optional<StampInfo> legs{};  ///< legs and body velocity: one clock; waited for once heard
  Duration
      timeshift_cam_imu{};  ///< t_imu = t_cam + this; IMU samples leave on the camera's time line
};

}  // namespace geoflow::timesync
