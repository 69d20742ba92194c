#pragma once

#include <cstdint>
#include <stop_token>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"

namespace geoflow::drivers {

/// A camera that is a device of this machine, with its own IMU if it has one.
///
/// Samples are delivered on the thread that calls run(). The ports' start, stop and health may be
/// called from other threads, but not from inside a sink. The ports live as long as this.
class LiveCamera {
 public:
  LiveCamera() = default;
  LiveCamera(const LiveCamera&) = delete;
  LiveCamera& operator=(const LiveCamera&) = delete;
  virtual ~LiveCamera() = default;

  [[nodiscard]] virtual const Calibration& calibration() const = 0;
  [[nodiscard]] virtual DepthCamera& camera() = 0;
  /// Null where it has none.
  [[nodiscard]] virtual Imu* imu() = 0;

  /// Streams until stopped, through every loss of the device that can be mended; a file that stands
  /// in for a device ends by itself. Returns within a tenth of a second of the stop, or as soon as
  /// a device that is being opened lets it.
  virtual void run(const std::stop_token& stop) = 0;
  /// How often run() has gone round: again within a few seconds, whether or not the device is
  /// there, but while that is opened or reset. Any thread, but not from inside a sink.
  [[nodiscard]] virtual std::uint64_t turns() const = 0;
};

}  // namespace geoflow::drivers
