// The camera of the module for tests: one that a script plays, at the pace of a real one.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/bytes.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/scripted_camera.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "openni2/module/platform.hpp"
#include "openni2/scripted_scene.hpp"

namespace geoflow::drivers::openni2 {
namespace {

using d435i::Transport;
using d435i::VideoStream;
using d435i::tests::Bytes;
using d435i::tests::ScriptedCamera;

Bytes pixels_of(VideoStream stream, std::uint32_t number, std::size_t size) {
  Bytes bytes(size);
  if (stream == VideoStream::kColor) {
    for (std::size_t i = 0; i < size; ++i) {
      bytes[i] = static_cast<std::byte>(tests::yuyv_byte(number, i));
    }
    return bytes;
  }
  for (std::size_t i = 0; 2 * i + 1 < size; ++i) {
    const std::uint16_t depth = tests::depth_mm(number, i);
    std::memcpy(bytes.data() + 2 * i, &depth, sizeof depth);
  }
  return bytes;
}

ScriptedCamera& camera() {
  static ScriptedCamera one = [] {
    ScriptedCamera made;
    made.serial = tests::kSerial;
    made.pixels = &pixels_of;
    return made;
  }();
  return one;
}

/// Passes on what has been made just now: a machine that is too slow for the camera's pace must not
/// look like a camera that has fallen silent.
class ArrivingNow final : public d435i::TransportSink {
 public:
  explicit ArrivingNow(d435i::TransportSink& inner) : inner_{inner} {}
  void on_frame(const d435i::RawFrame& frame) override {
    d435i::RawFrame arrived = frame;
    arrived.t_arrival = HostClock::now();
    inner_.on_frame(arrived);
  }
  void on_imu(const d435i::RawImu& imu) override { inner_.on_imu(imu); }
  void on_damaged_frame(VideoStream stream, std::string_view why) override {
    inner_.on_damaged_frame(stream, why);
  }
  void on_damaged_imu(std::string_view why) override { inner_.on_damaged_imu(why); }

 private:
  d435i::TransportSink& inner_;
};

/// Holds a scripted camera's own time back to the host's.
class PacedTransport final : public Transport {
 public:
  explicit PacedTransport(std::unique_ptr<Transport> inner) : inner_{std::move(inner)} {
    camera().now = HostClock::now();
  }
  [[nodiscard]] const d435i::LinkInfo& link() const override { return inner_->link(); }
  Result<void> set_control(std::uint8_t selector, std::span<const std::byte> value) override {
    return inner_->set_control(selector, value);
  }
  Result<void> get_control(std::uint8_t selector, std::span<std::byte> value) override {
    return inner_->get_control(selector, value);
  }
  Result<void> start_video(VideoStream stream, const d435i::VideoMode& mode) override {
    return inner_->start_video(stream, mode);
  }
  void stop_video(VideoStream stream) override { inner_->stop_video(stream); }
  Result<void> start_imu(d435i::ImuSensor sensor, int rate_hz) override {
    return inner_->start_imu(sensor, rate_hz);
  }
  void stop_imu(d435i::ImuSensor sensor) override { inner_->stop_imu(sensor); }
  Result<void> poll(Duration timeout, d435i::TransportSink& sink) override {
    std::this_thread::sleep_until(camera().now);
    ArrivingNow arriving{sink};
    return inner_->poll(timeout, arriving);
  }
  Result<void> reset() override { return inner_->reset(); }

 private:
  std::unique_ptr<Transport> inner_;
};

}  // namespace

std::vector<std::string> connected_cameras() {
  return {tests::kSerial};
}

d435i::OpenTransport camera_opener() {
  return [](const std::string& serial) {
    return camera().opener()(serial).map([](auto transport) -> std::unique_ptr<Transport> {
      return std::make_unique<PacedTransport>(std::move(transport));
    });
  };
}

}  // namespace geoflow::drivers::openni2
