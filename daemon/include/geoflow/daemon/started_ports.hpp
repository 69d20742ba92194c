#pragma once

#include "geoflow/daemon/sources.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// The ports of a source, started with one receiver for all and stopped at the end of scope.
/// Thread-bound.
class StartedPorts {
 public:
  explicit StartedPorts(const Ports& ports) : ports_{ports} {}
  StartedPorts(const StartedPorts&) = delete;
  StartedPorts& operator=(const StartedPorts&) = delete;
  ~StartedPorts() { stop(); }

  /// Starts every port there is. `receiver` is a CameraSink, an ImuSink and a LegSink, and must
  /// outlive stop().
  template <typename Receiver>
  [[nodiscard]] Result<void> start(Receiver& receiver) {
    Result<void> started;
    if (ports_.camera != nullptr) {
      started = ports_.camera->start(receiver);
    }
    if (started && ports_.imu != nullptr) {
      started = ports_.imu->start(receiver);
    }
    if (started && ports_.legs != nullptr) {
      started = ports_.legs->start(receiver);
    }
    return started;
  }

  void stop() const {
    if (ports_.camera != nullptr) {
      ports_.camera->stop();
    }
    if (ports_.imu != nullptr) {
      ports_.imu->stop();
    }
    if (ports_.legs != nullptr) {
      ports_.legs->stop();
    }
  }

 private:
  Ports ports_;
};

/// A receiver of all three ports.
class SampleReceiver : public CameraSink, public ImuSink, public LegSink {};

}  // namespace geoflow::daemon
