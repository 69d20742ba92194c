#pragma once

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// The ports of a source, started with one receiver for all and stopped at the end of scope.
/// Thread-bound.
class StartedPorts {
 public:
  explicit StartedPorts(drivers::RecordedStreams& streams) : streams_{streams} {}
  StartedPorts(const StartedPorts&) = delete;
  StartedPorts& operator=(const StartedPorts&) = delete;
  ~StartedPorts() { stop(); }

  /// Starts every port there is. `receiver` is a CameraSink, an ImuSink and a LegSink, and must
  /// outlive stop().
  template <typename Receiver>
  [[nodiscard]] Result<void> start(Receiver& receiver) {
    auto started = streams_.camera().start(receiver);
    if (started && streams_.imu() != nullptr) {
      started = streams_.imu()->start(receiver);
    }
    if (started && streams_.legs() != nullptr) {
      started = streams_.legs()->start(receiver);
    }
    return started;
  }

  void stop() {
    streams_.camera().stop();
    if (streams_.imu() != nullptr) {
      streams_.imu()->stop();
    }
    if (streams_.legs() != nullptr) {
      streams_.legs()->stop();
    }
  }

 private:
  drivers::RecordedStreams& streams_;
};

/// A receiver of all three ports.
class SampleReceiver : public CameraSink, public ImuSink, public LegSink {};

}  // namespace geoflow::daemon
