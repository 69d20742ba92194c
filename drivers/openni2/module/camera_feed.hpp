#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "d435i/core/camera_facts.hpp"
#include "d435i/core/session.hpp"
#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::openni2 {

/// A camera's 32-bit microseconds as 64-bit ones that go on where the count wraps, and where it
/// begins anew after a reset: then from the newest before it. Streams of one clock may lie a second
/// behind each other. Thread-bound.
class LongClock {
 public:
  [[nodiscard]] std::uint64_t extend(std::uint32_t count_us) noexcept;

 private:
  std::optional<std::uint32_t> newest_count_us_{};
  std::uint64_t newest_us_ = 0;
};

/// Raw frames of one camera, of each of its video streams for whoever wants them, on a thread of
/// its own that keeps the camera streaming (d435i::Session). Starting or stopping one stream
/// interrupts the other for as long as the camera takes to start. start and stop may be called from
/// any thread, but not from inside a handler.
class CameraFeed final : private d435i::TransportSink {
 public:
  /// Gets a frame, borrowed for the time of the call, and when it was taken [us].
  using Handler = std::function<void(const d435i::RawFrame&, std::uint64_t t_us)>;

  /// Opens the camera of that serial number for as long as it takes to read its calibration.
  [[nodiscard]] static Result<std::unique_ptr<CameraFeed>> open(const std::string& serial,
                                                                d435i::OpenTransport opener);
  CameraFeed(const CameraFeed&) = delete;
  CameraFeed& operator=(const CameraFeed&) = delete;
  ~CameraFeed() override;

  [[nodiscard]] const d435i::CameraTables& tables() const noexcept { return tables_; }
  [[nodiscard]] const std::vector<d435i::VideoMode>& modes() const noexcept { return modes_; }

  /// An error where the camera is gone, or has no such mode; the other stream then goes on.
  [[nodiscard]] Result<void> start(d435i::VideoStream stream, const d435i::VideoMode& mode,
                                   Handler handler);
  /// Once it returns, the stream's handler is not called again. Harmless when stopped.
  void stop(d435i::VideoStream stream);

 private:
  struct Wanted {
    d435i::VideoMode mode;
    Handler handler;
    d435i::StampSource stamps{};
  };

  CameraFeed(std::string serial, d435i::OpenTransport opener, d435i::CameraTables tables,
             std::vector<d435i::VideoMode> modes);

  void halt();
  [[nodiscard]] Result<void> resume();
  void run(const std::stop_token& stop);

  void on_frame(const d435i::RawFrame& frame) override;
  void on_imu(const d435i::RawImu& /*imu*/) override {}
  void on_damaged_frame(d435i::VideoStream stream, std::string_view why) override;
  void on_damaged_imu(std::string_view /*why*/) override {}

  const std::string serial_;
  const d435i::OpenTransport opener_;
  const d435i::CameraTables tables_;
  const std::vector<d435i::VideoMode> modes_;
  std::mutex changes_;  // one start or stop at a time; all below is the thread's while it runs
  std::array<std::optional<Wanted>, d435i::kVideoStreams> wanted_{};
  LongClock clock_;
  std::unique_ptr<d435i::Session> session_;
  std::mutex waiting_;
  std::condition_variable_any wake_;  // never notified: only a stop ends its waits
  std::jthread thread_;
};

}  // namespace geoflow::drivers::openni2
