#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/image_packer.hpp"
#include "src/stream_table.hpp"
#include "src/uvc_controls.hpp"

namespace geoflow::emulator {

/// What a stream shows of one instant. An infrared image needs depth as well, for the right imager.
struct SeenFrame {
  ColorFrame color{};
  DepthFrame depth{};
  Duration t{};                         ///< middle of the exposure, on the world's time line
  std::uint64_t stamp_us = 0;           ///< device clock when it is sent
  std::uint32_t since_exposure_us = 0;  ///< from the middle of the exposure to then
};

/// One VideoStreaming interface: negotiation, and frames until the host fetches them. It streams
/// from a commit on, while the host fetches: CLEAR_FEATURE(ENDPOINT_HALT) empties it, and the next
/// fetch goes on. (uvcvideo stops a bulk camera by that request and fetches no more; librealsense's
/// libusb backend sends it after the commit and when frames fail to come, and goes on.) So does
/// SET_INTERFACE. A host that only fetches no more has left the stream after a while.
class VideoStream {
 public:
  VideoStream(VideoStreamId id, const Calibration& calibration);

  /// A class request to this interface: probe and commit (UVC 1.5, 4.3.1.1: 48 bytes); none: STALL.
  [[nodiscard]] std::optional<Bytes> request(const SetupPacket& setup,
                                             std::span<const std::byte> out);

  /// Whether there is someone who fetches.
  [[nodiscard]] bool active() const noexcept { return committed_ && fetched_; }
  [[nodiscard]] bool has_frame() const noexcept { return !frames_.empty(); }

  /// Takes a frame, if it is one of those that the committed rate asks for.
  void see(SeenFrame frame);
  /// The oldest frame not yet fetched, as a UVC payload.
  [[nodiscard]] std::optional<Bytes> fetch(const UvcControls& controls, HostTime now);
  /// CLEAR_FEATURE(ENDPOINT_HALT), or SET_INTERFACE.
  void clear();
  /// clear(), where it is active but nobody has fetched for two seconds; whether that was so.
  bool end_if_left(HostTime now);
  /// As after power-on.
  void reset();

  [[nodiscard]] std::uint64_t sent() const noexcept { return sent_; }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  /// What is negotiated; indices from 1.
  struct Choice {
    std::uint8_t format = 1;
    std::uint8_t frame = 1;
    std::uint32_t interval_100ns = 0;
  };
  [[nodiscard]] const VideoFormat& format(const Choice& choice) const;
  [[nodiscard]] const FrameSize& size(const Choice& choice) const;
  [[nodiscard]] Choice nearest(Choice wanted) const;
  [[nodiscard]] Bytes block(const Choice& choice) const;
  void commit(const Choice& choice);

  VideoStreamId id_;
  const VideoInterface& interface_;
  Calibration calibration_;
  Choice probe_;
  Choice choice_;
  std::optional<ImagePacker> packer_;
  bool committed_ = false;
  bool fetched_ = false;
  HostTime fetched_at_{};  // the last time
  std::optional<Duration> due_;
  struct Numbered {
    SeenFrame frame;
    std::uint32_t counter = 0;
  };
  std::deque<Numbered> frames_;
  std::uint32_t counter_ = 0;
  bool odd_ = false;
  std::uint64_t sent_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace geoflow::emulator
