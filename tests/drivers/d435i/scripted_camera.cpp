#include "d435i/scripted_camera.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/bytes.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/golden.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/monitor/command.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

constexpr Duration kImuInterval = std::chrono::milliseconds{5};

std::size_t sensor_index(ImuSensor sensor) {
  return sensor == ImuSensor::kAccelerometer ? 0 : 1;
}

class ScriptedTransport final : public Transport {
 public:
  explicit ScriptedTransport(ScriptedCamera& camera) : camera_{camera} {
    const auto description =
        parse_configuration(camera.super_speed ? golden_configuration() : usb2_configuration());
    description_ = *description;
    link_ = {.transport = "scripted",
             .place = "2-1",
             .serial = camera.serial,
             .super_speed = camera.super_speed,
             .modes = list_modes(description_)};
  }

  [[nodiscard]] const LinkInfo& link() const override { return link_; }

  Result<void> set_control(std::uint8_t selector, std::span<const std::byte> value) override {
    if (selector == 1) {
      request_.assign(value.begin(), value.end());
      if (request_[4] == std::byte{0x20}) {
        camera_.calls.emplace_back("hardware reset");
        camera_.silent_until_hardware_reset = false;
        leave();
      }
      return {};
    }
    if (camera_.refuse_controls) {
      return fail(ErrorCode::kSystem, "control {} was refused", selector);
    }
    camera_.controls[selector] = {value.begin(), value.end()};
    return {};
  }

  Result<void> get_control(std::uint8_t selector, std::span<std::byte> value) override {
    if (selector != 1 || value.size() != kMonitorBytes || request_.empty()) {
      return fail(ErrorCode::kInvalidArgument, "no such control");
    }
    if (camera_.busy_answers > 0) {
      --camera_.busy_answers;
      return fail(ErrorCode::kUnavailable, "stalled");
    }
    std::ranges::copy(answer(), value.begin());
    return {};
  }

  Result<void> start_video(VideoStream stream, const VideoMode& mode) override {
    camera_.calls.push_back("start " + std::string{name_of(stream)});
    const auto chosen = choose_mode(description_, mode);
    if (!chosen) {
      return tl::unexpected{chosen.error()};
    }
    const auto index = static_cast<std::size_t>(stream);
    camera_.silent_starts.at(index) = std::max(0, camera_.silent_starts.at(index) - 1);
    interval_ = std::chrono::nanoseconds{std::chrono::seconds{1}} / mode.rate_hz;
    frame_bytes_.at(index) = chosen->frame_bytes;
    next_.at(index) = camera_.now + interval_;
    return {};
  }
  void stop_video(VideoStream stream) override {
    camera_.calls.push_back("stop " + std::string{name_of(stream)});
    next_.at(static_cast<std::size_t>(stream)).reset();
  }
  Result<void> start_imu(ImuSensor sensor, int /*rate_hz*/) override {
    camera_.calls.push_back(sensor == ImuSensor::kGyroscope ? "start gyro" : "start accel");
    next_imu_.at(sensor_index(sensor)) = camera_.now + kImuInterval;
    return {};
  }
  void stop_imu(ImuSensor sensor) override { next_imu_.at(sensor_index(sensor)).reset(); }

  Result<void> poll(Duration timeout, TransportSink& sink) override {
    const HostTime begin = camera_.now;
    const HostTime due = std::min(next_event(), begin + timeout);
    advance(due);
    if (camera_.streaming_lost || !camera_.present) {
      return fail(ErrorCode::kNotFound, "the camera is gone");
    }
    for (std::size_t i = 0; i < kVideoStreams; ++i) {
      if (next_.at(i) && *next_.at(i) <= due) {
        *next_.at(i) += interval_;
        send_frame(static_cast<VideoStream>(i), sink);
      }
    }
    for (const ImuSensor sensor : {ImuSensor::kAccelerometer, ImuSensor::kGyroscope}) {
      auto& next = next_imu_.at(sensor_index(sensor));
      if (next && *next <= due) {
        *next += kImuInterval;
        if (!camera_.imu_silent.at(sensor_index(sensor))) {
          sink.on_imu({.reading = {.sensor = sensor,
                                   .t_device_us = camera_.clock_us,
                                   .counts = {0, -1000, 0}},
                       .t_arrival = camera_.now});
        }
      }
    }
    return {};
  }

  Result<void> reset() override {
    camera_.calls.emplace_back("reset");
    camera_.silent_until_port_reset = false;
    leave();
    return {};
  }

 private:
  void leave() {
    camera_.streaming_lost = true;
    camera_.away_until = camera_.now + camera_.away_after_reset;
  }

  [[nodiscard]] HostTime next_event() const {
    HostTime earliest = HostTime::max();
    for (const auto& next : next_) {
      earliest = std::min(earliest, next.value_or(HostTime::max()));
    }
    for (const auto& next : next_imu_) {
      earliest = std::min(earliest, next.value_or(HostTime::max()));
    }
    return std::max(earliest, camera_.now);
  }

  void advance(HostTime t) {
    const auto step = std::chrono::duration_cast<std::chrono::microseconds>(t - camera_.now);
    camera_.clock_us += static_cast<std::uint32_t>(step.count());
    camera_.now = t;
  }

  void send_frame(VideoStream stream, TransportSink& sink) {
    const auto i = static_cast<std::size_t>(stream);
    ++camera_.frame_counter;
    if (camera_.silent.at(i) || camera_.silent_starts.at(i) > 0 ||
        camera_.silent_until_port_reset || camera_.silent_until_hardware_reset) {
      return;
    }
    if (camera_.damaged.at(i)) {
      sink.on_damaged_frame(stream, "half of it is missing");
      return;
    }
    const Bytes pixels = camera_.pixels
                             ? camera_.pixels(stream, camera_.frame_counter, frame_bytes_.at(i))
                             : Bytes(frame_bytes_.at(i));
    const Bytes header = golden_depth_header(camera_.clock_us, camera_.frame_counter);
    sink.on_frame({.stream = stream,
                   .pixels = pixels,
                   .header = camera_.no_header ? std::span<const std::byte>{} : header,
                   .t_arrival = camera_.now});
  }

  [[nodiscard]] Bytes answer() const {
    const auto opcode = std::to_integer<unsigned>(request_[4]);
    const auto parameter = std::to_integer<std::uint32_t>(request_[8]);
    std::optional<Bytes> data;
    if (opcode == 0x10) {
      data = golden_versions();
    } else if (opcode == 0x15 && camera_.tables.contains(parameter)) {
      data = camera_.tables.at(parameter);
    } else if (opcode == 0x4f) {
      data = camera_.imu_table;
    } else if (opcode == 0x7e) {
      data = camera_.resolution_list;
    } else if (opcode == 0x30) {
      data = from_hex("00");
    }
    Builder reply;
    reply.u32(data ? opcode : static_cast<std::uint32_t>(-21));
    if (data) {
      reply.bytes(*data);
    }
    return reply.zeros(1020 - reply.size()).u32(data ? data->size() : 0).get();
  }

  ScriptedCamera& camera_;
  UsbDescription description_;
  LinkInfo link_;
  Bytes request_;
  Duration interval_{std::chrono::seconds{1}};
  std::array<std::uint32_t, kVideoStreams> frame_bytes_{};
  std::array<std::optional<HostTime>, kVideoStreams> next_{};
  std::array<std::optional<HostTime>, 2> next_imu_{};
};

}  // namespace

ScriptedCamera::ScriptedCamera() {
  tables[25] = golden_depth_table();
  tables[32] = golden_color_table();
}

OpenTransport ScriptedCamera::opener() {
  return [this](const std::string& wanted) -> Result<std::unique_ptr<Transport>> {
    looks.push_back(now);
    if (!present || (away_until && now < *away_until) || (!wanted.empty() && wanted != serial)) {
      return fail(ErrorCode::kNotFound, "no D435i is connected");
    }
    away_until.reset();
    streaming_lost = false;
    return std::make_unique<ScriptedTransport>(*this);
  };
}

void ScriptedCamera::unplug() {
  present = false;
  streaming_lost = true;
}

void ScriptedCamera::plug_in() {
  present = true;
}

int ScriptedCamera::count(const std::string& call) const {
  return static_cast<int>(std::ranges::count(calls, call));
}

}  // namespace geoflow::drivers::d435i::tests
