#include "geoflow/tools/emulator/d435i.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <variant>

#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/world.hpp"

#include "src/descriptors.hpp"
#include "src/hardware_monitor.hpp"
#include "src/motion_module.hpp"
#include "src/options.hpp"
#include "src/stream_table.hpp"
#include "src/uvc_controls.hpp"
#include "src/video_stream.hpp"
#include "src/world_player.hpp"

namespace geoflow::emulator {
namespace {

constexpr unsigned kByteBits = 8;

enum Recipient : std::uint8_t { kDevice = 0, kInterface = 1, kEndpoint = 2 };
enum RequestType : std::uint8_t { kStandard = 0, kClass = 1 };
/// USB 3.2, table 9-5.
enum StandardRequest : std::uint8_t {
  kGetStatus = 0,
  kClearFeature = 1,
  kSetFeature = 3,
  kSetAddress = 5,
  kGetDescriptor = 6,
  kGetConfiguration = 8,
  kSetConfiguration = 9,
  kGetInterface = 10,
  kSetInterface = 11,
  kSetExitLatency = 48,
  kSetIsochronousDelay = 49,
};
constexpr std::uint16_t kEndpointHalt = 0;

/// A camera that restarts is off the bus for about as long as real ones (3 to 6 s).
constexpr std::chrono::seconds kRestartTime{4};

std::uint8_t recipient_of(const SetupPacket& setup) {
  constexpr unsigned kMask = 0x1f;
  return static_cast<std::uint8_t>(setup.request_type & kMask);
}

std::uint8_t type_of(const SetupPacket& setup) {
  constexpr unsigned kShift = 5;
  return static_cast<std::uint8_t>((setup.request_type >> kShift) & 3U);
}

class Camera final : public D435i {
 public:
  Camera(const D435iOptions& options, std::unique_ptr<World> world)
      : options_{options},
        player_{std::move(world)},
        monitor_{options, player_.calibration()},
        motion_{options.firmware >= kWideImuFirmware},
        streams_{VideoStream{VideoStreamId::kDepth, player_.calibration()},
                 VideoStream{VideoStreamId::kInfrared, player_.calibration()},
                 VideoStream{VideoStreamId::kColor, player_.calibration()}} {}

  [[nodiscard]] UsbSpeed speed() const override { return UsbSpeed::kSuper; }
  [[nodiscard]] std::optional<Bytes> control(const SetupPacket& setup,
                                             std::span<const std::byte> out, HostTime now) override;
  [[nodiscard]] InTransfer next_in(std::uint8_t endpoint, HostTime now) override;
  [[nodiscard]] HostTime next_due(std::uint8_t endpoint, HostTime now) override;
  [[nodiscard]] bool connected(HostTime now) override;
  void reset(HostTime now) override;
  [[nodiscard]] D435iCounters counters() const override;
  [[nodiscard]] std::optional<Duration> recording_shift() const override {
    return player_.recording_shift();
  }

 private:
  [[nodiscard]] std::optional<Bytes> answer(const SetupPacket& setup,
                                            std::span<const std::byte> out, HostTime now);
  [[nodiscard]] std::optional<Bytes> standard(const SetupPacket& setup);
  [[nodiscard]] std::optional<Bytes> class_request(const SetupPacket& setup,
                                                   std::span<const std::byte> out, HostTime now);
  [[nodiscard]] std::optional<Bytes> monitor(const SetupPacket& setup,
                                             std::span<const std::byte> out, HostTime now);
  [[nodiscard]] VideoStream& stream(VideoStreamId id) {
    return streams_[static_cast<std::size_t>(id)];
  }
  /// By its interface's number or endpoint; null where it has no such stream.
  [[nodiscard]] VideoStream* stream_with(std::uint8_t VideoInterface::* id, std::uint8_t value);
  /// Lets what has happened in the world up to now reach the sensors.
  void live(HostTime now);
  void sense(const WorldSample& sample);
  [[nodiscard]] bool fits(const FrameRef& image) const;
  [[nodiscard]] SeenFrame seen(const WorldSample& sample, std::uint32_t exposure_us) const;
  [[nodiscard]] std::uint64_t device_us(HostTime t) const;
  void forget();

  D435iOptions options_;
  WorldPlayer player_;
  UvcControls controls_;
  HardwareMonitor monitor_;
  MotionModule motion_;
  std::array<VideoStream, kVideoStreamCount> streams_;
  std::uint8_t configuration_ = 0;
  HostTime fetched_at_{};  ///< from any stream, the last time
  std::optional<HostTime> powered_at_;
  std::optional<HostTime> back_at_;  ///< while it restarts
  ColorFrame last_color_;
  DepthFrame last_depth_;
  std::uint64_t reports_sent_ = 0;
  std::uint64_t misfits_ = 0;
};

std::uint64_t Camera::device_us(HostTime t) const {
  const auto since =
      std::chrono::duration_cast<std::chrono::microseconds>(t - powered_at_.value_or(t));
  return options_.clock_start_us + static_cast<std::uint64_t>(since.count());
}

bool Camera::connected(HostTime now) {
  if (back_at_ && now >= *back_at_) {
    powered_at_ = back_at_;
    back_at_.reset();
    controls_ = UvcControls{};
  }
  return !back_at_;
}

void Camera::forget() {
  for (VideoStream& video : streams_) {
    video.reset();
  }
  motion_.reset();
  configuration_ = 0;
}

void Camera::reset(HostTime now) {
  live(now);
  forget();
}

VideoStream* Camera::stream_with(std::uint8_t VideoInterface::* id, std::uint8_t value) {
  const auto found = std::ranges::find(video_interfaces(), value, id);
  return found != video_interfaces().end()
             ? &streams_.at(static_cast<std::size_t>(found - video_interfaces().begin()))
             : nullptr;
}

bool Camera::fits(const FrameRef& image) const {
  const CameraIntrinsics& camera = player_.calibration().camera;
  return image && image.shape().width == camera.width && image.shape().height == camera.height;
}

SeenFrame Camera::seen(const WorldSample& sample, std::uint32_t exposure_us) const {
  const auto whole =
      std::chrono::duration_cast<std::chrono::microseconds>(sample.t_sent - sample.t);
  const auto since = std::clamp<std::int64_t>(whole.count(), 0, exposure_us / 2);
  return {.t = sample.t,
          .stamp_us = device_us(player_.host_time(sample.t)) + static_cast<std::uint64_t>(since),
          .since_exposure_us = static_cast<std::uint32_t>(since)};
}

void Camera::sense(const WorldSample& sample) {
  constexpr std::uint32_t kColorExposureUnitUs = 100;
  if (const auto* imu = std::get_if<ImuSample>(&sample.sample)) {
    motion_.feel(*imu, device_us(player_.host_time(sample.t)), sample.t);
    return;
  }
  const auto* color = std::get_if<ColorFrame>(&sample.sample);
  const auto* depth = std::get_if<DepthFrame>(&sample.sample);
  if (!fits(color != nullptr ? color->image : depth->image)) {
    ++misfits_;
    return;
  }
  const auto depth_exposure = static_cast<std::uint32_t>(controls_.value(DepthSelector::kExposure));
  if (color != nullptr) {
    last_color_ = *color;
    const auto exposure =
        static_cast<std::uint32_t>(controls_.value(kColorTerminal, kTerminalExposure));
    SeenFrame frame = seen(sample, exposure * kColorExposureUnitUs);
    frame.color = *color;
    stream(VideoStreamId::kColor).see(frame);
    frame = seen(sample, depth_exposure);
    frame.color = *color;
    frame.depth = last_depth_;
    stream(VideoStreamId::kInfrared).see(frame);
  } else {
    last_depth_ = *depth;
    SeenFrame frame = seen(sample, depth_exposure);
    frame.depth = *depth;
    stream(VideoStreamId::kDepth).see(frame);
  }
}

void Camera::live(HostTime now) {
  if (!powered_at_) {
    powered_at_ = now;
  }
  bool left = false;
  for (VideoStream& video : streams_) {
    left |= video.end_if_left(now);
  }
  const bool watching =
      motion_.active() || std::ranges::any_of(streams_, [](const auto& s) { return s.active(); });
  player_.run(watching, left ? fetched_at_ : now);
  while (const auto sample = player_.next(now)) {
    sense(*sample);
  }
}

std::optional<Bytes> Camera::control(const SetupPacket& setup, std::span<const std::byte> out,
                                     HostTime now) {
  live(now);
  if (!connected(now) || (!setup.is_in() && out.size() != setup.length)) {
    return std::nullopt;
  }
  auto data = answer(setup, out, now);
  if (data && data->size() > setup.length) {
    data->resize(setup.length);
  }
  if (monitor_.take_restart()) {
    forget();
    back_at_ = now + kRestartTime;
  }
  live(now);
  return data;
}

std::optional<Bytes> Camera::answer(const SetupPacket& setup, std::span<const std::byte> out,
                                    HostTime now) {
  switch (type_of(setup)) {
    case kStandard:
      return standard(setup);
    case kClass:
      return recipient_of(setup) == kInterface ? class_request(setup, out, now) : std::nullopt;
    default:
      return std::nullopt;  // Microsoft's descriptors, which Linux never asks for
  }
}

std::optional<Bytes> Camera::standard(const SetupPacket& setup) {
  const auto index = static_cast<std::uint8_t>(setup.index);
  switch (setup.request) {
    case kGetDescriptor:
      return descriptor(options_, setup.value);
    case kGetConfiguration:
      return ByteWriter{}.put(configuration_).take();
    case kSetConfiguration:
      forget();
      configuration_ = static_cast<std::uint8_t>(setup.value);
      return configuration_ <= 1 ? std::optional{Bytes{}} : std::nullopt;
    case kGetInterface:
      return ByteWriter{}.u8(0).take();
    case kSetInterface:
      if (setup.value != 0) {
        return std::nullopt;  // no interface has another setting
      }
      if (VideoStream* video = stream_with(&VideoInterface::number, index)) {
        video->clear();
      }
      return Bytes{};
    case kGetStatus:
      return ByteWriter{}.u16(recipient_of(setup) == kDevice ? 1 : 0).take();  // self-powered
    case kClearFeature:
      if (recipient_of(setup) == kEndpoint && setup.value == kEndpointHalt) {
        if (VideoStream* video = stream_with(&VideoInterface::endpoint, index)) {
          video->clear();
        }
      }
      return Bytes{};
    case kSetFeature:
    case kSetAddress:
    case kSetExitLatency:
    case kSetIsochronousDelay:
      return Bytes{};
    default:
      return std::nullopt;
  }
}

std::optional<Bytes> Camera::class_request(const SetupPacket& setup, std::span<const std::byte> out,
                                           HostTime now) {
  const auto interface = static_cast<std::uint8_t>(setup.index);
  const auto entity = static_cast<std::uint8_t>(setup.index >> kByteBits);
  if (interface == kHidInterface) {
    return motion_.request(setup, out);
  }
  if (interface == kDepthControlInterface || interface == kColorControlInterface) {
    const auto selector = static_cast<DepthSelector>(setup.value >> kByteBits);
    if (interface == kDepthControlInterface && entity == kDepthExtension) {
      if (selector == DepthSelector::kHardwareMonitor) {
        return monitor(setup, out, now);
      }
      // Projector and chip valid, and their temperatures [deg C]; known only while depth streams.
      constexpr std::int64_t kTemperatures = 0x24220101;
      const bool on = stream(VideoStreamId::kDepth).active();
      controls_.set(DepthSelector::kTemperatures, on ? kTemperatures : 0);
    }
    return controls_.request(setup, out);
  }
  VideoStream* const video = stream_with(&VideoInterface::number, interface);
  return video != nullptr && entity == 0 ? video->request(setup, out) : std::nullopt;
}

std::optional<Bytes> Camera::monitor(const SetupPacket& setup, std::span<const std::byte> out,
                                     HostTime now) {
  switch (static_cast<UvcRequest>(setup.request)) {
    case UvcRequest::kSetCur:
      monitor_.request(out, device_us(now));
      return Bytes{};
    case UvcRequest::kGetCur:
      return monitor_.reply();
    case UvcRequest::kGetMax:
      return Bytes(kMonitorSize, ~std::byte{0});
    case UvcRequest::kGetMin:
    case UvcRequest::kGetRes:
    case UvcRequest::kGetDef:
      return Bytes(kMonitorSize);
    case UvcRequest::kGetLen:
      return ByteWriter{}.u16(kMonitorSize).take();
    case UvcRequest::kGetInfo:
      return ByteWriter{}.u8(3).take();  // get and set
    default:
      return std::nullopt;
  }
}

InTransfer Camera::next_in(std::uint8_t endpoint, HostTime now) {
  if (!connected(now)) {
    return {};
  }
  live(now);
  std::optional<Bytes> data;
  if (endpoint == kHidEndpoint) {
    data = motion_.next_report();
    reports_sent_ += data ? 1U : 0U;
  } else if (VideoStream* video = stream_with(&VideoInterface::endpoint, endpoint)) {
    const bool was_active = video->active();
    fetched_at_ = now;
    data = video->fetch(controls_, now);
    if (!was_active) {
      live(now);
    }
  }
  return data ? InTransfer{.status = InStatus::kData, .data = std::move(*data)} : InTransfer{};
}

HostTime Camera::next_due(std::uint8_t endpoint, HostTime now) {
  if (back_at_) {
    return *back_at_;
  }
  const VideoStream* video = stream_with(&VideoInterface::endpoint, endpoint);
  if (video == nullptr && endpoint != kHidEndpoint) {
    return HostTime::max();
  }
  const bool ready = video != nullptr ? video->has_frame() : motion_.has_report();
  return ready ? now : player_.next_due();
}

D435iCounters Camera::counters() const {
  D435iCounters counters{.reports_sent = reports_sent_,
                         .reports_dropped = motion_.dropped(),
                         .world_errors = player_.errors() + misfits_};
  for (const VideoStream& video : streams_) {
    counters.frames_sent += video.sent();
    counters.frames_dropped += video.dropped();
  }
  return counters;
}

}  // namespace

Result<std::unique_ptr<D435i>> D435i::create(const D435iOptions& options,
                                             std::unique_ptr<World> world) {
  if (auto checked = check_options(options, world->calibration()); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  return std::make_unique<Camera>(options, std::move(world));
}

}  // namespace geoflow::emulator
