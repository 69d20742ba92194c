#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// The ports: how any source of samples, device or recording, hands them over.
///
/// A port is started with a sink and calls it from one thread of its own choosing (the driver's, or
/// the one that steps a recording), in order of arrival, until stop() has returned. Sinks must not
/// block. start, stop and health may be called from one other thread.
namespace geoflow {

/// How a stream is stamped.
enum class StampDomain : std::uint8_t {
  kDevice,  ///< by a clock inside the device: needs a clock model
  kHost,  ///< t_device already is on the host's time line (recordings whose stamps were mapped when
          ///< made)
};

/// What timesync must know of a stream's stamps.
struct StampInfo {
  StampDomain domain = StampDomain::kHost;
  /// The counter's period, where it wraps (2^32 us for UVC metadata); none where it does not.
  std::optional<Duration> wrap{};
  /// Of an IMU: by the very clock that stamps the camera's images.
  bool on_camera_clock = false;
};

enum class SourceState : std::uint8_t { kStopped, kStreaming, kDegraded, kFailed };

/// A source's health. Counters never decrease.
struct SourceHealth {
  SourceState state = SourceState::kStopped;
  std::string reason;           ///< a sentence, empty while all is well
  std::uint64_t delivered = 0;  ///< samples handed to the sink
  std::uint64_t rejected = 0;   ///< samples that could not be decoded
  std::uint64_t dropped = 0;    ///< samples lost for want of a buffer
};

class CameraSink {
 public:
  CameraSink() = default;
  CameraSink(const CameraSink&) = delete;
  CameraSink& operator=(const CameraSink&) = delete;
  virtual ~CameraSink() = default;
  virtual void on_color(const Arrival<CameraClock, ColorFrame>& frame) = 0;
  virtual void on_depth(const Arrival<CameraClock, DepthFrame>& frame) = 0;
};

class ImuSink {
 public:
  ImuSink() = default;
  ImuSink(const ImuSink&) = delete;
  ImuSink& operator=(const ImuSink&) = delete;
  virtual ~ImuSink() = default;
  virtual void on_imu(const Arrival<ImuClock, ImuSample>& sample) = 0;
};

class LegSink {
 public:
  LegSink() = default;
  LegSink(const LegSink&) = delete;
  LegSink& operator=(const LegSink&) = delete;
  virtual ~LegSink() = default;
  virtual void on_legs(const Arrival<LegClock, LegSample>& sample) = 0;
  virtual void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) = 0;
};

/// One source of samples of one kind. See the head of this file for the thread rule.
template <typename Sink>
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;

  /// Begins delivery to `sink`, which must outlive the matching stop(). An error leaves the source
  /// stopped.
  [[nodiscard]] virtual Result<void> start(Sink& sink) = 0;
  /// Ends delivery: once it returns, the sink is not called again. Harmless when stopped.
  virtual void stop() = 0;
  [[nodiscard]] virtual SourceHealth health() const = 0;
  [[nodiscard]] virtual StampInfo stamps() const = 0;
};

using DepthCamera = Source<CameraSink>;
using Imu = Source<ImuSink>;
using Legs = Source<LegSink>;

}  // namespace geoflow
