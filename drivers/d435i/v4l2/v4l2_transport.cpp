#include "d435i/v4l2/v4l2_transport.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <poll.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "usb/node_reset.hpp"
#include "v4l2/iio_sensor.hpp"
#include "v4l2/topology.hpp"
#include "v4l2/video_device.hpp"

namespace geoflow::drivers::d435i {
namespace {

using v4l2::fourcc;

constexpr std::uint32_t kZ16 = fourcc('Z', '1', '6', ' ');
constexpr std::uint32_t kYuyv = fourcc('Y', 'U', 'Y', 'V');
// The camera's own metadata, or the standard header alone, which all kernels know.
constexpr std::array kMetadataFormats{fourcc('D', '4', 'X', 'X'), fourcc('U', 'V', 'C', 'H')};

constexpr std::uint8_t kExtensionUnit = 3;
constexpr std::uint8_t kSetCurrent = 0x01;
constexpr std::uint8_t kGetCurrent = 0x81;

constexpr int kVideoBuffers = 4;
constexpr int kMetadataBuffers = 8;
constexpr int kSuperSpeed_mbps = 5000;
constexpr std::size_t kHostPrefixBytes = sizeof(std::uint64_t) + sizeof(std::uint16_t);
// A stamp of the kernel's clock is the host's wall clock; the camera's counts from its power-on.
constexpr Duration kNearWallClock = std::chrono::hours{1};

/// A video node and the metadata node beside it.
struct Pair {
  v4l2::VideoDevice video;
  std::optional<v4l2::VideoDevice> metadata{};
  std::optional<std::pair<std::uint32_t, std::vector<std::byte>>>
      header{};  ///< newest, by sequence
};

/// Whether a stamp is one of the host's wall clock rather than the camera's.
bool is_wall_clock(std::int64_t t_ns) {
  const Duration now = std::chrono::system_clock::now().time_since_epoch();
  const Duration off = now - Duration{t_ns};
  return off < kNearWallClock && off > -kNearWallClock;
}

class V4l2Transport final : public Transport {
 public:
  V4l2Transport(const v4l2::UsbCamera& camera, std::array<Pair, kVideoStreams> pairs)
      : camera_{camera}, pairs_{std::move(pairs)} {
    link_ = {.transport = "v4l2",
             .place = camera.place,
             .serial = camera.serial,
             .super_speed = camera.speed_mbps >= kSuperSpeed_mbps,
             .device_stamps = pairs_[0].metadata.has_value(),
             .modes = {}};
    list(PixelCoding::kZ16, kZ16, pairs_[0].video);
    list(PixelCoding::kYuyv, kYuyv, pairs_[1].video);
  }

  [[nodiscard]] const LinkInfo& link() const override { return link_; }

  Result<void> set_control(std::uint8_t selector, std::span<const std::byte> value) override {
    std::vector<std::byte> copy{value.begin(), value.end()};  // the kernel's call wants it writable
    return pairs_[0].video.query_unit(kExtensionUnit, selector, kSetCurrent, copy);
  }
  Result<void> get_control(std::uint8_t selector, std::span<std::byte> value) override {
    return pairs_[0].video.query_unit(kExtensionUnit, selector, kGetCurrent, value);
  }

  Result<void> start_video(VideoStream stream, const VideoMode& mode) override;
  void stop_video(VideoStream stream) override {
    Pair& pair = pairs_.at(static_cast<std::size_t>(stream));
    pair.video.stop();
    if (pair.metadata) {
      pair.metadata->stop();
    }
    pair.header.reset();
  }
  Result<void> start_imu(ImuSensor sensor, int rate_hz) override;
  void stop_imu(ImuSensor sensor) override { sensors_.at(index_of(sensor)).reset(); }
  Result<void> poll(Duration timeout, TransportSink& sink) override;
  Result<void> reset() override { return usb::reset_node(camera_.usb_node); }

 private:
  static std::size_t index_of(ImuSensor sensor) {
    return sensor == ImuSensor::kAccelerometer ? 0 : 1;
  }
  void list(PixelCoding coding, std::uint32_t code, const v4l2::VideoDevice& node) {
    for (const v4l2::NodeMode& mode : node.modes(code)) {
      link_.modes.push_back({coding, mode.width, mode.height, mode.rate_hz});
    }
  }
  [[nodiscard]] std::vector<pollfd> descriptors() const;
  [[nodiscard]] Result<void> read_video(VideoStream stream, TransportSink& sink);
  [[nodiscard]] static Result<void> read_metadata(Pair& pair);
  [[nodiscard]] Result<void> read_imu(ImuSensor sensor, TransportSink& sink);

  v4l2::UsbCamera camera_;
  std::array<Pair, kVideoStreams> pairs_;
  std::array<std::unique_ptr<v4l2::IioSensor>, 2> sensors_{};
  LinkInfo link_;
  /// One sensor stamped by the host makes both so: their stamps must compare.
  bool imu_stamped_by_host_ = false;
};

Result<void> V4l2Transport::start_video(VideoStream stream, const VideoMode& mode) {
  if (std::ranges::find(link_.modes, mode) == link_.modes.end()) {
    return fail(ErrorCode::kNotFound,
                "the camera has no {} of {}x{} at {} Hz on this link; it has {}", name_of(stream),
                mode.width, mode.height, mode.rate_hz, describe_modes(link_.modes, mode.coding));
  }
  stop_video(stream);
  Pair& pair = pairs_.at(static_cast<std::size_t>(stream));
  const std::uint32_t code = stream == VideoStream::kDepth ? kZ16 : kYuyv;
  auto started = pair.video.set_video_format(
      code, {.width = mode.width, .height = mode.height, .rate_hz = mode.rate_hz});
  if (started && pair.metadata) {
    // First, so that the first frame has its header.
    started = pair.metadata->set_metadata_format(kMetadataFormats).and_then([&] {
      return pair.metadata->start(kMetadataBuffers);
    });
  }
  return started ? pair.video.start(kVideoBuffers) : started;
}

Result<void> V4l2Transport::start_imu(ImuSensor sensor, int rate_hz) {
  const std::string_view name = sensor == ImuSensor::kAccelerometer ? "accel_3d" : "gyro_3d";
  const auto node = std::ranges::find(camera_.iio, name, &v4l2::IioNode::name);
  if (node == camera_.iio.end()) {
    return fail(ErrorCode::kNotFound,
                "the kernel shows no {}: are the modules hid-sensor-hub, hid-sensor-accel-3d and "
                "hid-sensor-gyro-3d loaded? (transport = \"libusb\" does without them)",
                name);
  }
  const auto code = rate_code(rate_hz);
  if (!code) {
    return tl::unexpected{code.error()};
  }
  stop_imu(sensor);
  return v4l2::IioSensor::start(*node, *code).map([&](auto started) {
    sensors_.at(index_of(sensor)) = std::move(started);
  });
}

std::vector<pollfd> V4l2Transport::descriptors() const {
  std::vector<pollfd> all;
  for (const Pair& pair : pairs_) {
    if (pair.video.streaming()) {
      all.push_back({.fd = pair.video.fd(), .events = POLLIN, .revents = 0});
    }
  }
  for (const auto& sensor : sensors_) {
    if (sensor) {
      all.push_back({.fd = sensor->fd(), .events = POLLIN, .revents = 0});
    }
  }
  return all;
}

Result<void> V4l2Transport::poll(Duration timeout, TransportSink& sink) {
  auto all = descriptors();
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  if (::poll(all.data(), all.size(), static_cast<int>(wait)) < 0 && errno != EINTR) {
    return fail(ErrorCode::kSystem, "poll: {}", std::system_category().message(errno));
  }
  // All are looked at: a sensor that is gone says so only when it is read.
  for (const VideoStream stream : {VideoStream::kDepth, VideoStream::kColor}) {
    if (auto done = read_video(stream, sink); !done) {
      return done;
    }
  }
  for (const ImuSensor sensor : {ImuSensor::kAccelerometer, ImuSensor::kGyroscope}) {
    if (auto done = read_imu(sensor, sink); !done) {
      return done;
    }
  }
  std::error_code error;
  if (!std::filesystem::exists(camera_.usb_node, error)) {
    return fail(ErrorCode::kNotFound, "the camera at {} is gone", camera_.place);
  }
  return {};
}

Result<void> V4l2Transport::read_metadata(Pair& pair) {
  while (pair.metadata && pair.metadata->streaming()) {
    auto filled = pair.metadata->take();
    if (!filled) {
      return tl::unexpected{std::move(filled.error())};
    }
    if (!*filled) {
      break;
    }
    pair.header = {(*filled)->sequence, header_in_metadata((*filled)->bytes)};
    if (auto given = pair.metadata->give_back(**filled); !given) {
      return given;
    }
  }
  return {};
}

Result<void> V4l2Transport::read_video(VideoStream stream, TransportSink& sink) {
  Pair& pair = pairs_.at(static_cast<std::size_t>(stream));
  while (pair.video.streaming()) {
    auto filled = pair.video.take();
    if (!filled) {
      return tl::unexpected{std::move(filled.error())};
    }
    if (!*filled) {
      break;
    }
    const HostTime t_arrival = HostClock::now();
    // The kernel completes a frame's metadata before the frame.
    if (auto read = read_metadata(pair); !read) {
      return read;
    }
    const bool matches = pair.header && pair.header->first == (*filled)->sequence;
    if ((*filled)->damaged) {
      sink.on_damaged_frame(stream, "the kernel says that it is damaged");
    } else {
      sink.on_frame({.stream = stream,
                     .pixels = (*filled)->bytes,
                     .header = matches ? std::span<const std::byte>{pair.header->second}
                                       : std::span<const std::byte>{},
                     .t_arrival = t_arrival});
    }
    if (auto given = pair.video.give_back(**filled); !given) {
      return given;
    }
  }
  return {};
}

Result<void> V4l2Transport::read_imu(ImuSensor sensor, TransportSink& sink) {
  constexpr int kWideBits = 32;
  constexpr std::int64_t kNsPerUs = 1000;
  const auto& its = sensors_.at(index_of(sensor));
  if (!its) {
    return {};
  }
  const auto readings = its->take();
  if (!readings) {
    if (readings.error().code == ErrorCode::kNotFound) {
      return tl::unexpected{readings.error()};
    }
    sink.on_damaged_imu(readings.error().message);
    return {};
  }
  const HostTime t_arrival = HostClock::now();
  for (const v4l2::IioReading& reading : *readings) {
    imu_stamped_by_host_ = imu_stamped_by_host_ || is_wall_clock(reading.t_ns);
    sink.on_imu({.reading = {.sensor = sensor,
                             .layout = its->axis_bits() == kWideBits ? ImuLayout::k32Bit
                                                                     : ImuLayout::k16Bit,
                             .t_device_us = static_cast<std::uint32_t>(reading.t_ns / kNsPerUs),
                             .counts = reading.counts},
                 .device_stamped = !imu_stamped_by_host_,
                 .t_arrival = t_arrival});
  }
  return {};
}

/// A capture node of `code`, with the metadata node that the kernel makes right after it.
Result<Pair> find_pair(const v4l2::UsbCamera& camera, std::uint32_t code, std::string_view name) {
  std::optional<Error> refused;
  for (std::size_t i = 0; i < camera.video.size(); ++i) {
    auto device = v4l2::VideoDevice::open(camera.video[i].path);
    if (!device) {
      refused = device.error();
      continue;
    }
    if (device->is_metadata() || !device->has_format(code)) {
      continue;
    }
    Pair pair{.video = std::move(*device)};
    if (i + 1 < camera.video.size() && camera.video[i + 1].interface == camera.video[i].interface) {
      auto next = v4l2::VideoDevice::open(camera.video[i + 1].path);
      if (next && next->is_metadata()) {
        pair.metadata = std::move(*next);
      }
    }
    return pair;
  }
  if (refused) {
    return tl::unexpected{*refused};
  }
  return fail(ErrorCode::kNotFound,
              "the kernel shows no {} node for the camera at {}: is the module uvcvideo loaded?",
              name, camera.place);
}

}  // namespace

std::vector<std::byte> header_in_metadata(std::span<const std::byte> buffer) {
  if (buffer.size() <= kHostPrefixBytes) {
    return {};
  }
  const auto rest = buffer.subspan(kHostPrefixBytes);
  const auto length = std::min(std::to_integer<std::size_t>(rest[0]), rest.size());
  std::vector<std::byte> header{rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(length)};
  if (!header.empty()) {
    header[0] = static_cast<std::byte>(length);
  }
  return header;
}

Result<std::unique_ptr<Transport>> open_v4l2_transport(const v4l2::UsbCamera& camera) {
  auto depth = find_pair(camera, kZ16, "depth");
  if (!depth) {
    return tl::unexpected{std::move(depth.error())};
  }
  auto color = find_pair(camera, kYuyv, "colour");
  if (!color) {
    return tl::unexpected{std::move(color.error())};
  }
  return std::make_unique<V4l2Transport>(
      camera, std::array<Pair, kVideoStreams>{std::move(*depth), std::move(*color)});
}

}  // namespace geoflow::drivers::d435i
