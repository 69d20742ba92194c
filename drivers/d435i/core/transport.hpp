#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/imu/reports.hpp"
#include "d435i/uvc/descriptors.hpp"

/// What the core needs of a way to the camera: the kernel's drivers (V4L2, IIO) or USB itself.
namespace geoflow::drivers::d435i {

enum class VideoStream : std::uint8_t { kDepth, kColor };
inline constexpr std::size_t kVideoStreams = 2;

[[nodiscard]] constexpr std::string_view name_of(VideoStream stream) noexcept {
  return stream == VideoStream::kDepth ? "depth" : "colour";
}

/// One frame as the camera sent it; everything is borrowed for the time of the call.
struct RawFrame {
  VideoStream stream = VideoStream::kDepth;
  std::span<const std::byte> pixels;
  std::span<const std::byte> header{};  ///< payload header with metadata; empty: none came
  HostTime t_arrival;
};

struct RawImu {
  ImuReading reading;
  bool device_stamped = true;  ///< else the reading's own time says nothing
  HostTime t_arrival;
};

/// Gets what arrives, on the thread that polls.
class TransportSink {
 public:
  TransportSink() = default;
  TransportSink(const TransportSink&) = delete;
  TransportSink& operator=(const TransportSink&) = delete;
  virtual ~TransportSink() = default;
  virtual void on_frame(const RawFrame& frame) = 0;
  virtual void on_imu(const RawImu& imu) = 0;
  /// A frame that came, but not whole.
  virtual void on_damaged_frame(VideoStream stream, std::string_view why) = 0;
  /// An IMU report that could not be read.
  virtual void on_damaged_imu(std::string_view why) = 0;
};

/// What a link is; it stays as long as the transport.
struct LinkInfo {
  std::string transport;         ///< "v4l2" or "libusb"
  std::string place;             ///< bus and ports, as in sysfs: "2-1.4"
  std::string serial;            ///< what USB shows as serial number (that of the ASIC)
  bool super_speed = true;       ///< false: a USB 2 link, with fewer modes
  bool device_stamps = true;     ///< false: no payload header reaches the host
  std::vector<VideoMode> modes;  ///< what the camera offers on this link
};

/// One open camera. Thread-bound. Nothing blocks longer than its own bound, which is at most half a
/// second; poll() not longer than its timeout.
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;

  [[nodiscard]] virtual const LinkInfo& link() const = 0;

  /// Controls of the depth function's extension unit. kUnavailable: the camera is busy, try again.
  [[nodiscard]] virtual Result<void> set_control(std::uint8_t selector,
                                                 std::span<const std::byte> value) = 0;
  [[nodiscard]] virtual Result<void> get_control(std::uint8_t selector,
                                                 std::span<std::byte> value) = 0;

  /// Starts a stream that is stopped; a halt of its endpoint is cleared.
  [[nodiscard]] virtual Result<void> start_video(VideoStream stream, const VideoMode& mode) = 0;
  /// Harmless when stopped.
  virtual void stop_video(VideoStream stream) = 0;
  /// May return before the sensor is on.
  [[nodiscard]] virtual Result<void> start_imu(ImuSensor sensor, int rate_hz) = 0;
  virtual void stop_imu(ImuSensor sensor) = 0;

  /// Waits for what comes, and hands it on. An Error: the camera is gone, this transport is of no
  /// more use.
  [[nodiscard]] virtual Result<void> poll(Duration timeout, TransportSink& sink) = 0;

  /// Resets the camera's USB port. The camera may come back under another address: close and open.
  [[nodiscard]] virtual Result<void> reset() = 0;
};

/// Opens the camera of a serial number; empty: the first one found. kNotFound where there is none.
using OpenTransport = std::function<Result<std::unique_ptr<Transport>>(const std::string& serial)>;

}  // namespace geoflow::drivers::d435i
