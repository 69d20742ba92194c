#include "d435i/usb/usb_transport.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/usb/assembler.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "d435i/uvc/payload.hpp"
#include "usb/port.hpp"

namespace geoflow::drivers::d435i {
namespace {

// bmRequestType: class request to an interface, out and in.
constexpr std::uint8_t kToInterface = 0x21;
constexpr std::uint8_t kFromInterface = 0xa1;
// bRequest of video (UVC 1.5, A.8) and of HID (1.11, 7.2).
constexpr std::uint8_t kSetCurrent = 0x01;
constexpr std::uint8_t kGetCurrent = 0x81;
constexpr std::uint8_t kGetReport = 0x01;
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kFeatureReport = 0x0300;
// wValue of the two stream controls (UVC 1.5, A.9.8).
constexpr std::uint16_t kProbe = 0x0100;
constexpr std::uint16_t kCommit = 0x0200;

constexpr std::uint8_t kExtensionUnit = 3;
constexpr unsigned kHighByte = 8;

constexpr std::size_t kLargestHeader = 255;
constexpr std::size_t kPacketBytes = 1024;
constexpr int kVideoTransfers = 3;
constexpr int kImuTransfers = 8;
constexpr std::size_t kImuTransferBytes = 64;

constexpr std::array kSensors{ImuSensor::kAccelerometer, ImuSensor::kGyroscope};

std::uint16_t high_byte(std::uint8_t high, std::uint8_t low = 0) {
  return static_cast<std::uint16_t>(high << kHighByte | low);
}

class UsbTransport final : public Transport, private usb::InSink {
 public:
  UsbTransport(std::unique_ptr<usb::Port> port, UsbDescription description)
      : port_{std::move(port)},
        description_{std::move(description)},
        link_{.transport = "libusb",
              .place = port_->info().place,
              .serial = port_->info().serial,
              .super_speed = port_->info().super_speed,
              .modes = list_modes(description_)} {}

  [[nodiscard]] const LinkInfo& link() const override { return link_; }

  Result<void> set_control(std::uint8_t selector, std::span<const std::byte> value) override {
    return port_->control_out({.type = kToInterface,
                               .request = kSetCurrent,
                               .value = high_byte(selector),
                               .index = high_byte(kExtensionUnit, control_interface())},
                              value);
  }
  Result<void> get_control(std::uint8_t selector, std::span<std::byte> value) override {
    return port_
        ->control_in({.type = kFromInterface,
                      .request = kGetCurrent,
                      .value = high_byte(selector),
                      .index = high_byte(kExtensionUnit, control_interface())},
                     value)
        .and_then([&](std::size_t size) -> Result<void> {
          if (size != value.size()) {
            return fail(ErrorCode::kInvalidData, "control {} has {} bytes instead of {}", selector,
                        size, value.size());
          }
          return {};
        });
  }

  Result<void> start_video(VideoStream stream, const VideoMode& mode) override;
  void stop_video(VideoStream stream) override;
  Result<void> start_imu(ImuSensor sensor, int rate_hz) override;
  void stop_imu(ImuSensor sensor) override;

  Result<void> poll(Duration timeout, TransportSink& sink) override {
    sink_ = &sink;
    auto polled = port_->poll(timeout, *this);
    sink_ = nullptr;
    return polled;
  }
  Result<void> reset() override { return port_->reset(); }

 private:
  struct Video {
    std::uint8_t endpoint = 0;
    FrameAssembler assembler;
  };

  [[nodiscard]] std::uint8_t control_interface() const {
    return description_.controls.front().number;
  }
  Result<ProbeCommit> negotiate(const ModeChoice& choice);
  Result<ImuFeature> read_feature(ImuSensor sensor);
  Result<void> write_feature(const ImuFeature& feature);

  void on_transfer(std::uint8_t endpoint, usb::TransferStatus status,
                   std::span<const std::byte> data, HostTime t_arrival) override;
  void on_video(VideoStream stream, usb::TransferStatus status, std::span<const std::byte> data,
                HostTime t_arrival);
  void on_report(std::span<const std::byte> report, HostTime t_arrival);

  std::unique_ptr<usb::Port> port_;
  UsbDescription description_;
  LinkInfo link_;
  std::array<std::optional<Video>, kVideoStreams> videos_{};
  std::array<bool, 2> imu_on_{};
  std::optional<ImuLayout> imu_layout_{};  ///< of the reports so far
  TransportSink* sink_ = nullptr;
};

Result<ProbeCommit> UsbTransport::negotiate(const ModeChoice& choice) {
  const auto control = std::ranges::find_if(description_.controls, [&](const auto& one) {
    return std::ranges::find(one.streaming, choice.interface) != one.streaming.end();
  });
  const std::uint16_t version =
      control == description_.controls.end() ? std::uint16_t{0} : control->uvc_version;
  auto block = encode_probe(choice, version);
  const auto out = [&](std::uint16_t which) {
    return port_->control_out(
        {.type = kToInterface, .request = kSetCurrent, .value = which, .index = choice.interface},
        block);
  };
  if (auto asked = out(kProbe); !asked) {
    return tl::unexpected{std::move(asked.error()).in("probe")};
  }
  const auto size = port_->control_in(
      {.type = kFromInterface, .request = kGetCurrent, .value = kProbe, .index = choice.interface},
      block);
  auto answer =
      size.and_then([&](std::size_t bytes) { return parse_probe(std::span{block}.first(bytes)); });
  if (!answer) {
    return tl::unexpected{std::move(answer.error()).in("probe")};
  }
  if (answer->format_index != choice.format_index || answer->frame_index != choice.frame_index ||
      answer->interval_100ns != choice.interval_100ns) {
    return fail(ErrorCode::kUnsupported,
                "the camera offers format {}, frame {}, interval {} where {}, {}, {} was asked for",
                answer->format_index, answer->frame_index, answer->interval_100ns,
                choice.format_index, choice.frame_index, choice.interval_100ns);
  }
  if (auto committed = out(kCommit); !committed) {
    return tl::unexpected{std::move(committed.error()).in("commit")};
  }
  return answer;
}

Result<void> UsbTransport::start_video(VideoStream stream, const VideoMode& mode) {
  const auto choice = choose_mode(description_, mode);
  if (!choice) {
    return tl::unexpected{choice.error()};
  }
  // What is left of an earlier run, and a halt, go by it; a camera that is fresh minds it not.
  if (auto cleared = port_->clear_halt(choice->endpoint);
      !cleared && cleared.error().code == ErrorCode::kNotFound) {
    return cleared;
  }
  const auto agreed = negotiate(*choice);
  if (!agreed) {
    return tl::unexpected{agreed.error()};
  }
  // Room for a whole payload and more, so that each transfer ends with its short packet.
  const std::size_t payload_bytes = std::max<std::size_t>(
      agreed->max_payload_bytes, std::size_t{choice->frame_bytes} + kLargestHeader);
  constexpr std::size_t kLargestPayload = std::size_t{1} << 24U;
  if (payload_bytes > kLargestPayload) {
    return fail(ErrorCode::kInvalidData, "the camera announces payloads of {} bytes",
                payload_bytes);
  }
  videos_.at(static_cast<std::size_t>(stream)) =
      Video{.endpoint = choice->endpoint, .assembler = FrameAssembler{choice->frame_bytes}};
  return port_->start_in({.endpoint = choice->endpoint,
                          .transfer_bytes = (payload_bytes / kPacketBytes + 1) * kPacketBytes,
                          .transfers = kVideoTransfers});
}

void UsbTransport::stop_video(VideoStream stream) {
  auto& video = videos_.at(static_cast<std::size_t>(stream));
  if (video) {
    port_->stop_in(video->endpoint);
    (void)port_->clear_halt(video->endpoint);  // by which the camera stops; one that is gone has
    video.reset();
  }
}

Result<ImuFeature> UsbTransport::read_feature(ImuSensor sensor) {
  std::array<std::byte, kFeatureBytes> report{};
  return port_
      ->control_in(
          {.type = kFromInterface,
           .request = kGetReport,
           .value = static_cast<std::uint16_t>(kFeatureReport | static_cast<std::uint16_t>(sensor)),
           .index = description_.hid->number},
          report)
      .and_then(
          [&](std::size_t size) { return parse_feature_report(std::span{report}.first(size)); });
}

Result<void> UsbTransport::write_feature(const ImuFeature& feature) {
  return port_->control_out({.type = kToInterface,
                             .request = kSetReport,
                             .value = static_cast<std::uint16_t>(
                                 kFeatureReport | static_cast<std::uint16_t>(feature.sensor)),
                             .index = description_.hid->number},
                            encode_feature_report(feature));
}

Result<void> UsbTransport::start_imu(ImuSensor sensor, int rate_hz) {
  if (!description_.hid) {
    return fail(ErrorCode::kNotFound, "the camera shows no HID interface");
  }
  const auto code = rate_code(rate_hz);
  auto feature = read_feature(sensor);
  if (!code || !feature) {
    return tl::unexpected{code ? feature.error() : code.error()};
  }
  feature->power = kPowerFull;
  feature->interval_ms = interval_of(*code);
  if (auto written = write_feature(*feature); !written) {
    return written;
  }
  const auto now = read_feature(sensor);
  if (!now || now->power != kPowerFull) {
    return now ? fail(ErrorCode::kUnavailable, "the sensor does not turn on")
               : Result<void>{tl::unexpected{now.error()}};
  }
  const bool reading = std::ranges::find(imu_on_, true) != imu_on_.end();
  imu_on_.at(sensor == kSensors[0] ? 0 : 1) = true;
  return reading ? Result<void>{}
                 : port_->start_in({.endpoint = description_.hid->endpoint,
                                    .interrupt = true,
                                    .transfer_bytes = kImuTransferBytes,
                                    .transfers = kImuTransfers});
}

void UsbTransport::stop_imu(ImuSensor sensor) {
  bool& on = imu_on_.at(sensor == kSensors[0] ? 0 : 1);
  if (!on) {
    return;
  }
  on = false;
  if (auto feature = read_feature(sensor)) {
    feature->power = kPowerOff;
    (void)write_feature(*feature);  // one that is gone is off
  }
  if (std::ranges::find(imu_on_, true) == imu_on_.end()) {
    port_->stop_in(description_.hid->endpoint);
  }
}

void UsbTransport::on_transfer(std::uint8_t endpoint, usb::TransferStatus status,
                               std::span<const std::byte> data, HostTime t_arrival) {
  if (description_.hid && endpoint == description_.hid->endpoint) {
    if (status == usb::TransferStatus::kCompleted) {
      on_report(data, t_arrival);
    } else {
      sink_->on_damaged_imu("a transfer failed");
    }
    return;
  }
  for (std::size_t i = 0; i < kVideoStreams; ++i) {
    if (videos_.at(i) && videos_.at(i)->endpoint == endpoint) {
      on_video(static_cast<VideoStream>(i), status, data, t_arrival);
    }
  }
}

void UsbTransport::on_video(VideoStream stream, usb::TransferStatus status,
                            std::span<const std::byte> data, HostTime t_arrival) {
  if (status != usb::TransferStatus::kCompleted) {
    sink_->on_damaged_frame(stream, status == usb::TransferStatus::kStalled
                                        ? "the endpoint is halted"
                                        : "a transfer failed");
    return;
  }
  const auto outcome = videos_.at(static_cast<std::size_t>(stream))->assembler.add(data);
  if (!outcome.damage.empty()) {
    sink_->on_damaged_frame(stream, outcome.damage);
  }
  if (!outcome.pixels.empty()) {
    sink_->on_frame({.stream = stream,
                     .pixels = outcome.pixels,
                     .header = outcome.header,
                     .t_arrival = t_arrival});
  }
}

void UsbTransport::on_report(std::span<const std::byte> report, HostTime t_arrival) {
  constexpr std::byte kTemperatures{3};
  if (!report.empty() && report.front() == kTemperatures) {
    return;
  }
  const auto reading = parse_input_report(report);
  if (!reading) {
    sink_->on_damaged_imu(reading.error().message);
    return;
  }
  // The layout is the firmware's, which does not change while the camera is there: read by the
  // other one, a damaged report would be a motion.
  if (reading->layout != imu_layout_.value_or(reading->layout)) {
    sink_->on_damaged_imu("a report in another layout than those before it");
    return;
  }
  imu_layout_ = reading->layout;
  sink_->on_imu({.reading = *reading, .device_stamped = true, .t_arrival = t_arrival});
}

}  // namespace

Result<std::unique_ptr<Transport>> open_usb_transport(std::unique_ptr<usb::Port> port) {
  auto description =
      port->configuration().and_then([](const auto& bytes) { return parse_configuration(bytes); });
  if (!description) {
    return tl::unexpected{std::move(description.error())};
  }
  const auto& controls = description->controls;
  const bool has_unit =
      !controls.empty() &&
      std::ranges::find(controls.front().extension_units, kExtensionUnit, &ExtensionUnit::id) !=
          controls.front().extension_units.end();
  if (!has_unit) {
    return fail(ErrorCode::kUnsupported, "the device at {} has no extension unit {}: no D435i",
                port->info().place, kExtensionUnit);
  }
  std::vector<std::uint8_t> interfaces;
  for (const ControlInterface& control : controls) {
    interfaces.push_back(control.number);
  }
  for (const StreamingInterface& stream : description->streams) {
    interfaces.push_back(stream.number);
  }
  if (description->hid) {
    interfaces.push_back(description->hid->number);
  }
  for (const std::uint8_t interface : interfaces) {
    if (auto claimed = port->claim(interface); !claimed) {
      return tl::unexpected{std::move(claimed.error())};
    }
  }
  return std::make_unique<UsbTransport>(std::move(port), std::move(*description));
}

}  // namespace geoflow::drivers::d435i
