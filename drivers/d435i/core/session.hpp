#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::d435i {

/// How the camera is to run. What is none is left as the camera has it.
struct SessionOptions {
  std::optional<VideoMode> depth;       ///< none: this stream is not wanted
  std::optional<VideoMode> color;       ///< likewise
  int accel_hz = 200;                   // NOLINT(readability-magic-numbers): named by its member
  int gyro_hz = 200;                    // NOLINT(readability-magic-numbers): likewise
  bool imu = true;                      ///< false: neither of its sensors is started
  std::optional<bool> emitter{};        ///< the pattern projector
  std::optional<int> exposure_us{};     ///< of depth; turns automatic exposure off
  std::optional<int> laser_power_mw{};  ///< of the projector
};

/// What happened. Never decreases.
struct SessionCounters {
  std::array<std::uint64_t, kVideoStreams> frames{};
  std::array<std::uint64_t, kVideoStreams> damaged{};
  std::uint64_t imu_reports = 0;
  std::uint64_t imu_damaged = 0;
  std::uint64_t stalls = 0;           ///< a video stream fell silent
  std::uint64_t stream_restarts = 0;  ///< rung 1: of one stream
  std::uint64_t camera_restarts = 0;  ///< rung 2: of all streams
  std::uint64_t port_resets = 0;      ///< rung 3: of the USB port
  std::uint64_t hardware_resets = 0;  ///< rung 4: of the camera by itself
  std::uint64_t imu_restarts = 0;
  std::uint64_t losses = 0;  ///< the camera left
  std::uint64_t opens = 0;   ///< it was opened, the first time included
};

enum class SessionState : std::uint8_t { kAway, kStreaming };

/// Keeps one camera streaming, whatever it takes. Thread-bound; time is an argument; nothing
/// blocks.
///
/// A video stream without a frame for ten intervals (at least 0.3 s; 1.5 s after its start) is
/// stalled, and each further stall before all streams run again goes one rung up the ladder: that
/// stream is restarted (which clears a halt), all streams are, the port is reset, the camera resets
/// itself. After the last two, and when the camera is gone, it is looked for by its serial number,
/// at once and then at intervals that double from 0.1 s to 2 s. A sensor of the IMU that is silent
/// for a second after it was heard, or for three after its start, is restarted, at intervals that
/// double likewise; video goes on.
class Session final : private TransportSink {
 public:
  /// `sink` gets what arrives and must outlive this. `first`, if any, is the camera already open;
  /// it is started by the first step().
  Session(const SessionOptions& options, OpenTransport open, TransportSink& sink,
          std::unique_ptr<Transport> first = nullptr, std::string serial = {});

  /// Does what is due at `now`, and then waits for samples, at most `longest`. The answer is how
  /// long nothing would happen without waiting here: 0 where it has waited for the camera.
  [[nodiscard]] Duration step(HostTime now, Duration longest);

  /// Stops all streams and closes the camera.
  void close();

  [[nodiscard]] SessionState state() const noexcept { return state_; }
  /// A sentence about what is wrong now; empty while all video, and the whole IMU, runs.
  [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
  [[nodiscard]] const std::string& imu_trouble() const noexcept { return imu_trouble_; }
  /// Null while the camera is away.
  [[nodiscard]] const LinkInfo* link() const noexcept {
    return transport_ ? &transport_->link() : nullptr;
  }
  [[nodiscard]] const SessionCounters& counters() const noexcept { return counters_; }

 private:
  struct Stream {
    HostTime deadline;  ///< no frame by then: a stall
    bool heard = false;
  };
  struct Sensor {
    HostTime deadline;
    Duration retry{};
    bool running = false;
  };

  void on_frame(const RawFrame& frame) override;
  void on_imu(const RawImu& imu) override;
  void on_damaged_frame(VideoStream stream, std::string_view why) override;
  void on_damaged_imu(std::string_view why) override;

  void look_for_camera(HostTime now);
  [[nodiscard]] Result<void> start_all(HostTime now);
  [[nodiscard]] Result<void> start_all_video(HostTime now);
  [[nodiscard]] Result<void> start_video(VideoStream stream, HostTime now);
  void configure();
  void start_imu(ImuSensor sensor, HostTime now);
  void watch_video(HostTime now);
  void watch_imu(HostTime now);
  void climb(const std::vector<VideoStream>& stalled, HostTime now);
  void lose(HostTime now, const std::string& why);
  [[nodiscard]] const std::optional<VideoMode>& mode_of(VideoStream stream) const noexcept;
  [[nodiscard]] std::vector<VideoStream> wanted_streams() const;
  [[nodiscard]] bool all_video_heard() const;
  [[nodiscard]] Duration patience(VideoStream stream) const noexcept;

  SessionOptions options_;
  OpenTransport open_;
  TransportSink& sink_;
  std::string serial_;
  std::unique_ptr<Transport> transport_;
  SessionState state_ = SessionState::kAway;
  std::string trouble_;
  std::string imu_trouble_;
  SessionCounters counters_;
  std::array<Stream, kVideoStreams> streams_{};
  std::array<Sensor, 2> sensors_{};
  int rung_ = 0;  ///< of the ladder: the next one to take
  Duration back_off_{};
  std::optional<HostTime> next_look_{};  ///< none: at once
};

}  // namespace geoflow::drivers::d435i
