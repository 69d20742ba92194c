#pragma once

#include <memory>
#include <stop_token>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// The ports of a configuration's sources; null: there is none.
struct Ports {
  DepthCamera* camera = nullptr;
  Imu* imu = nullptr;
  Legs* legs = nullptr;
};

/// What a configuration names as the origin of samples: a recording or a camera, and devices that
/// stand in for some of its sensors. For its thread rules see hal/ports.hpp.
struct Sources {
  std::unique_ptr<drivers::RecordedStreams> streams{};  ///< null: no recording is the source
  std::unique_ptr<drivers::LiveCamera> camera{};        ///< in the place of a recording; or null
  Calibration calibration{};     ///< the source's, changed where a device stands in for a sensor
  std::shared_ptr<Legs> legs{};  ///< a device's, in the place of the source's; null: none
  std::shared_ptr<Imu> imu{};    ///< likewise

  [[nodiscard]] Ports ports();
  /// Delivers what comes from the recording or the camera, at its pace, until the recording ends or
  /// it is stopped; returns at once where there is neither. The other devices deliver on threads of
  /// their own from their start to their stop.
  [[nodiscard]] Result<void> play(const std::stop_token& stop) const;
  /// What the thread in play() shows of itself; any thread.
  [[nodiscard]] ThreadActivity activity() const;
  /// A time on the recording's own time line; of a device the same.
  [[nodiscard]] HostTime to_recording_time(HostTime t) const;
};

/// What can be known to be wrong with the configured sources without any device: names, what does
/// not go together, a calibration folder that a camera's is to be completed from. Errors name key
/// or file; kInvalidArgument, or as of load_calibration().
[[nodiscard]] Result<void> check_sources(const Config& config);

/// Opens what `config.source` names, which may be legs or an IMU alone. `color` is the format of
/// colour images: kGray8, which is what the estimator wants and costs least, or kBgr8. Errors are
/// those of check_sources(), and of what cannot be opened; they name file, line or key.
[[nodiscard]] Result<Sources> open_sources(const Config& config, PixelFormat color);

}  // namespace geoflow::daemon
